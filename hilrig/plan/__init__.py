"""The stage "plan": from an experiment to its trials, each checked as far as it can be without running it."""

from hilrig.plan.planning import plan as plan
from hilrig.trial import Limits as Limits
from hilrig.trial import PhaseSpec as PhaseSpec
from hilrig.trial import TaskSpec as TaskSpec
from hilrig.trial import Trial as Trial
from hilrig.trial import impedance as impedance
from hilrig.trial import inputs as inputs
from hilrig.trial import make_task as make_task
from hilrig.trial import references as references
from hilrig.trial import start_joint_position as start_joint_position
from hilrig.trial import times as times

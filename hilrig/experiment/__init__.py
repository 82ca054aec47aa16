"""The stage "check": from the experiment file to an Experiment, or to everything that is wrong with it."""

from hilrig.experiment.loading import experiment_schema as experiment_schema
from hilrig.experiment.loading import load as load
from hilrig.experiment.model import Expectation as Expectation
from hilrig.experiment.model import Experiment as Experiment
from hilrig.experiment.model import ImpedanceSpec as ImpedanceSpec
from hilrig.experiment.model import Phase as Phase
from hilrig.experiment.model import Task as Task
from hilrig.experiment.trial import Limits as Limits
from hilrig.experiment.trial import TimingBudget as TimingBudget

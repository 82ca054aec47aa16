"""The stage "plan": from an experiment to its trials, each checked as far as possible without running it."""

from hilrig.experiment.plan.planning import plan as plan

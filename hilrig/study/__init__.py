"""Reproduces a published study: runs its experiments, draws its figures and judges its claims, as one file says."""

from hilrig.study.loading import Loaded as Loaded
from hilrig.study.loading import load_study as load_study
from hilrig.study.making import make_reproduction as make_reproduction

"""A study made again: its experiments run, its figures drawn, its claims judged. One file says which."""

from hilrig.study.loading import Loaded as Loaded
from hilrig.study.loading import load_study as load_study
from hilrig.study.making import make_reproduction as make_reproduction

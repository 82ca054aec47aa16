"""A study made again: its experiments run, its figures drawn, its claims judged. One file says which."""

from hilrig.reproduction.loading import Loaded as Loaded
from hilrig.reproduction.loading import load_study as load_study
from hilrig.reproduction.making import make_reproduction as make_reproduction

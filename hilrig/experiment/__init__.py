"""The experiment file, from YAML to a checked plan of trials: schema, model, feasibility.

What others use of this room is in `__init__.pyi`, imported when first used: the processes of the rig read trials, and
do without YAML.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""The experiment file, from YAML to a checked plan of trials: schema, model, feasibility.

The public names of this package are in `__init__.pyi`, imported on first use: the rig's processes read trials and do
not need YAML.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""hilrig: hardware-in-the-loop experiments for robot force-position control.

The public names, for authors of plug-ins and for analysis, are those of `__init__.pyi` beside this file. Each is
imported when it is first used: `hilrig --help` needs none of them.
"""

import lazy_loader

from hilrig.core import moved_modules

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
moved_modules.announce()

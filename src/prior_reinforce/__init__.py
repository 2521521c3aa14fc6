"""Hit a goal a robot arm has never hit, in about ten real trials (Prior Reinforce).

Everything that examples and docs need stands here: `import prior_reinforce as pr`. The list of
names is `__init__.pyi`; each is imported when it is first used, so that a command that needs no
network does not wait for one.
"""

from importlib.metadata import version

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = version("prior-reinforce")

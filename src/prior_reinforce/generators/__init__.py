"""pi: conditional motion generators. All share the interface of `base`, and any can be `Timed`.

Each name is imported when it is first used, so that a command that plans nothing loads none.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Hit a goal a robot arm has never hit, in about ten trials, simulated so far (Prior Reinforce).

Everything that examples and docs need stands here: `import prior_reinforce as pr`. The list of
names is `__init__.pyi`; each is imported when it is first used, so that a command that needs no
network does not wait for one.
"""

import lazy_loader

__version__ = "0.1.0"
_member, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """A public name, imported now."""
    try:
        return _member(name)
    except ImportError as error:
        from prior_reinforce.extras import missing_extra

        missing = missing_extra(error)
        if missing is None:
            raise
        raise missing from error

"""What surfeit raises and warns of, besides Python's own exceptions."""


class DamagedFile(OSError):
    """A file whose bytes break the rules of its format. The text says where, found and expected."""


class Incomplete(RuntimeError):
    """Shards of a job are missing, damaged or of another job; the text names them. Do these again."""


class DataWarning(UserWarning):
    """Data that was guessed, skipped, narrowed or left out: what, how many, and what to do.

    Each rule is told once per call. `strict=True` raises it instead.
    """

"""The program's errors by kind, which its exit code tells, and its warnings."""

from typing import Any


class Error(Exception):
    """The program failed. The text says what is wrong, where, and what to do; `--some-option` in it is `some_option` here."""

    def __init__(self, message: str, exit_code: int = 70, result: Any = None):
        super().__init__(message)
        self.exit_code = exit_code
        #: What the program printed as JSON before it failed, such as the report of a failed check; or None.
        self.result = result


class UsageError(Error, ValueError):
    """Options or a configuration file are wrong, or a folder cannot be written."""


class SceneError(Error):
    """The scene's data is bad or missing."""


class ModelError(Error):
    """ONNX Runtime or SAM is missing or broken; `gprop setup` fetches them."""


class AnswerError(Error):
    """An answer is missing: it is not recorded and no server is named, the model refused, or the budget is spent."""


class BatchError(Error):
    """Some of several objects or scenes failed; the others are done."""


class BugError(Error):
    """A bug in gprop, or the system ended the program."""


class SceneWarning(UserWarning):
    """A warning of the program: something in the scene or the result should be checked."""


#: By exit code. Another one is a bug.
KINDS: dict[int, type[Error]] = {2: UsageError, 3: SceneError, 4: ModelError, 5: AnswerError, 6: BatchError}

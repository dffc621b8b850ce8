"""How a command ends that cannot do what was asked."""

FAILURE, USAGE = 1, 2  # exit codes: the file, scene or output will not do; the command line cannot be meant so


class Refused(Exception):
    """What ends the command; the message is one sentence."""

    def __init__(self, sentence: str, code: int = FAILURE):
        super().__init__(sentence)
        self.code = code


def reason(error: BaseException) -> str:
    """Blender's words without their prefix, on one line: of an operator that failed, the last part says why."""
    line = (str(error).strip() or type(error).__name__).splitlines()[0].removeprefix("Error:").strip().rstrip(".")
    return line.rpartition(": ")[2] if "failed: " in line else line

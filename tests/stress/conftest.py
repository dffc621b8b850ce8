"""The stage of the technique tests, shared."""

from tests.techniques.conftest import kept_stage  # noqa: F401

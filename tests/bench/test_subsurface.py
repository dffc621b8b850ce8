"""The table of processor seconds for equal error below surfaces."""

from bench import subsurface


def row(label, error, seconds):
    return "leaf", "BURLEY", label, error, "1 1 1", seconds, "0.0010"


def test_denoised_cycles_is_asked_for_the_least_that_errs_no_more():
    rows = [
        row("Candela 1", "0.0150", "0.10"), row("Candela 16", "0.0010", "0.90"),
        row("Cycles denoised 4", "0.0200", "0.05"),
        row("Cycles denoised 16", "0.0070", "0.11"), row("Cycles denoised 64", "0.0030", "0.33"),
    ]  # fmt: skip
    one, sixteen = subsurface.equal(rows)
    assert one[2:] == ("1", "0.0150", "0.10", "16 samples, 0.0070", "0.11")
    assert sixteen[2:] == ("16", "0.0010", "0.90", "none of these", "–")

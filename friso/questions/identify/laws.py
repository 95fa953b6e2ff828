"""Say which friction laws a record supports."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from friso.quantities import percent
from friso.shown.documents import entries

if TYPE_CHECKING:
    from friso.identification.laws.comparison import LawComparison, LawPrediction

TITLE = "Friction laws, fitted to the same logs"


def law_sentence(comparison: LawComparison) -> str:
    """Say in a sentence which friction laws the records support."""
    best, supported = comparison.predictions[0], comparison.supported
    if not supported:
        return (
            f"None of the laws predicts the record: {best.law}, the best, is off by {_error_share(best)} of the "
            "friction where it was not fitted."
        )
    names = _laws_with_errors(supported)
    if len(supported) == len(comparison.predictions):
        return (
            f"The record does not distinguish the laws: {names} predict what they were not fitted to. Loops of force "
            "over displacement before sliding, of several amplitudes, would (rehearsed by friso rig presliding)."
        )
    others = [law for law in comparison.predictions if law not in supported]
    worse = _laws_with_errors(others)
    return (
        f"The record supports {names}, which {_predict(supported)} best what was left out of the fit; {worse} "
        f"{_predict(others)} worse."
    )


def _predict(laws: Sequence[LawPrediction]) -> str:
    """Return the verb for a number of laws: "predicts" for one, "predict" for several."""
    return "predicts" if len(laws) == 1 else "predict"


def law_facts(comparison: LawComparison) -> tuple[tuple[str, str], ...]:
    """List for each law its error and its fitted keys.

    Logs that were left out follow, with the reason.
    """
    laws = tuple((prediction.law, _errors_and_keys(prediction)) for prediction in comparison.predictions)
    return laws + tuple((f"{name}, left out", why) for name, why in comparison.left_out.items())


def how(comparison: LawComparison) -> str:
    """Say in a sentence how the laws were compared."""
    whole = comparison.parts == len(comparison.logs)
    parts = "each of the logs" if whole else f"each of {comparison.parts} pieces of the logs"
    begun = "the stage file" if comparison.unseen else "all logs, since none can from the law of the stage file"
    return (
        f"Left out by turns: {parts}. Fits begin from mass and friction of {begun}; what lies between force and guide "
        "is that which all logs show. Errors are RMS, as shares of the standard deviation of the friction; a law is "
        "supported unless it predicts worse than the best by more than 1 % and by more than chance would have it."
    )


def laws_document(comparison: LawComparison) -> dict[str, Any]:
    """Return the friction laws compared, with errors and fitted keys, for the JSON document."""
    supported = [law.law for law in comparison.supported]
    return {
        "supported": supported,
        **entries(comparison, "logs", "left_out"),
        "laws": [
            {
                **entries(prediction, "law", "error", "errors"),
                "supported": prediction.law in supported,
                "mass_kg": prediction.fit.mass,
                "keys": dict(prediction.fit.keys),
            }
            for prediction in comparison.predictions
        ],
    }


def _error_share(prediction: LawPrediction) -> str:
    """Write the error of a law as a fraction of the friction's deviation."""
    return percent(prediction.error)


def _laws_with_errors(laws: Sequence[LawPrediction]) -> str:
    """Write the names of some friction laws, each with the error of its prediction."""
    return ", ".join(f"{law.law} (off by {_error_share(law)})" for law in laws)


def _errors_and_keys(prediction: LawPrediction) -> str:
    """Write the errors of a law and the keys that were fitted."""
    low, high = percent(prediction.errors.min()), percent(prediction.errors.max())
    keys = ", ".join(f"{key.removeprefix('friction.')} {value:.4g}" for key, value in prediction.fit.keys.items())
    return f"off by {_error_share(prediction)} ({low} to {high}); {keys}"

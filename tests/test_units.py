"""Units that are read without pint."""

from friso.quantities import by_pint, common_units


def test_common_units_are_what_pint_says() -> None:
    """To add a unit, write what `by_pint` returns for it into friso/units.json."""
    units = common_units()
    assert len(units) > 100
    for text, kept in units.items():
        assert tuple(kept) == by_pint(text), text

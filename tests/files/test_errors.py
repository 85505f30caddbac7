import pickle

import pytest

from semgs.files.errors import InputError


def test_an_input_error_keeps_its_sentence_and_its_parts_between_processes():
    error = InputError("a/b.json", "a number", "a word", key="frames[3]", advice="mend it")
    there = pickle.loads(pickle.dumps(error))
    assert type(there) is InputError
    assert str(there) == str(error)
    assert (there.path, there.expected, there.found, there.key) == (error.path, "a number", "a word", "frames[3]")


def test_a_long_value_is_cut_in_the_middle() -> None:
    """Half of 500 characters less the five of " ... " is 247."""
    error = InputError("a.json", "a number", f"'{600 * '1'}2'", f"k{600 * '3'}")
    assert error.found == f"'{246 * '1'} ... {245 * '1'}2'"
    assert str(error) == f"a.json: k{246 * '3'} ... {247 * '3'}: expected a number, found {error.found}"
    assert InputError("a.json", "a number", 500 * "1").found == 500 * "1"


def test_an_error_about_the_same_file_is_not_repeated():
    inner = InputError("a.exr", "a channel Z", "R, G, B", advice="name one")
    outer = InputError("a.exr", "an OpenEXR image", str(inner), advice="see docs")
    assert str(outer) == "a.exr: expected a channel Z, found R, G, B; name one; see docs"
    assert str(InputError("b.exr", "an OpenEXR image", str(inner))).startswith(
        "b.exr: expected an OpenEXR image, found a.exr"
    )


@pytest.mark.parametrize(
    "said",
    [
        "Storage plugin 'x' not supported; please report issue.",
        "Storage plugin 'x' not supported. Please file a bug at https",
        "Storage plugin 'x' not supported, please report this issue",
    ],
)
def test_what_other_libraries_ask_for_is_left_out(said: str):
    assert (
        str(InputError("bag", "a bag", said)).rstrip(".")
        == "bag: expected a bag, found Storage plugin 'x' not supported"
    )

import pickle

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

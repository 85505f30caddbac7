import pickle

from semgs.files.errors import InputError


def test_an_input_error_keeps_its_sentence_and_its_parts_between_processes():
    error = InputError("a/b.json", "a number", "a word", key="frames[3]", advice="mend it")
    there = pickle.loads(pickle.dumps(error))
    assert type(there) is InputError
    assert str(there) == str(error)
    assert (there.path, there.expected, there.found, there.key) == (error.path, "a number", "a word", "frames[3]")

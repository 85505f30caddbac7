"""What a source says about itself."""

from __future__ import annotations

from semgs.sources.source import MadeBy, Source


class OfNetwork(Source):
    """Says only which network it is."""

    @property
    def made_by(self) -> MadeBy:
        return MadeBy("hf:owner/net@main", "0f", "MIT", "a" * 40)


class OfFiles(Source):
    """Says only what it is."""

    @property
    def title(self) -> str:
        return "maps in files"


def test_a_source_has_the_title_of_its_network_unless_it_says_another():
    assert OfNetwork().title == "hf:owner/net@main (licence MIT)"
    assert (OfFiles().title, OfFiles().made_by) == ("maps in files", None)


def test_the_commit_replaces_the_branch_in_what_pins_a_model():
    assert OfNetwork().made_by.pinned == f"hf:owner/net@{'a' * 40}"
    assert MadeBy("net.onnx", "0f").pinned == "net.onnx"

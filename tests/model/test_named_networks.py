"""The networks that have names."""

from __future__ import annotations

from dataclasses import replace

from networks import preset

from semgs.model import networks
from semgs.model.settings import Conventions, MVSplatHeads, PaperHeads
from semgs.model.switches import switched
from semgs.model.weights.load import shipped
from semgs.model.weights.weights_file import read_header


def test_the_paper_word_by_word_is_base_in_all_else():
    literal, base = networks.base_text(), networks.base()
    assert literal.conventions == Conventions(candidates="linear")
    assert literal.colour.heads == PaperHeads()
    assert not literal.colour.transformer.output_transform
    assert not literal.semantic.transformer.output_transform
    back = replace(
        literal,
        name="base",
        conventions=base.conventions,
        colour=replace(
            literal.colour,
            heads=MVSplatHeads(),
            transformer=replace(literal.colour.transformer, output_transform=True),
        ),
        semantic=replace(literal.semantic, transformer=replace(literal.semantic.transformer, output_transform=True)),
    )
    assert back == base


def test_small_is_the_network_of_the_included_weights_but_for_their_second_network_for_classes():
    assert switched(networks.small(), {"class_mosaic": True}) == read_header(shipped("small")).settings


def test_the_paper_word_by_word_has_the_parameters_of_its_heads():
    """13,286,056 is the number of `base` with the paper's heads, in docs/method.md; the other readings have no parameters."""
    assert sum(parameter.numel() for parameter in preset("base_text").parameters()) == 13_286_056

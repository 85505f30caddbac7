"""Names that the documentation taught before the folders of rooms had names of their own."""

from semgs.rooms import dataset, demo, stream
from semgs.rooms.sets.dataset import Recipe, write_dataset
from semgs.rooms.sets.demo import demo_scene
from semgs.rooms.sets.stream import RoomSamples, sample


def test_names_that_were_taught_are_still_there():
    assert (dataset.Recipe, dataset.write_dataset) == (Recipe, write_dataset)
    assert (stream.RoomSamples, stream.sample) == (RoomSamples, sample)
    assert demo.demo_scene is demo_scene

"""The files of a reconstruction: report, images, page and recording."""

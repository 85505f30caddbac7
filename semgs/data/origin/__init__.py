"""Where scenes come from: licences, labelling networks, and the record of prepared scenes."""

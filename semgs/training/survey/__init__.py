"""Survey: what the data of a run are. Scenes are opened, checked and counted before it starts."""

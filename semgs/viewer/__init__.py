"""An interactive 3D viewer of scenes in the browser, by viser (extra `viewer`)."""

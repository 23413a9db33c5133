"""Files of two cameras, of other tools and our own: text to a Rig; `formats.RIG_FORMATS` lists them."""

"""OctoMap: three-dimensional maps as octrees, in files `.bt` and `.ot`."""

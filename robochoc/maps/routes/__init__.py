"""Routes of one robot through the free pixels or voxels of a map."""

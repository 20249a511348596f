CREATE VIRTUAL TABLE patch_places USING rtree (patch, min_island, max_island, min_x_m, max_x_m, min_y_m, max_y_m,
  min_height_m, max_height_m);

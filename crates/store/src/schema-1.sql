CREATE TABLE versions (version INTEGER PRIMARY KEY, program TEXT NOT NULL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE digests (name TEXT PRIMARY KEY, rows INTEGER NOT NULL, sum INTEGER NOT NULL, checksum INTEGER NOT NULL)
  STRICT, WITHOUT ROWID;
CREATE TABLE changes (change INTEGER PRIMARY KEY, step INTEGER NOT NULL, kind TEXT NOT NULL, payload BLOB NOT NULL,
  chain INTEGER NOT NULL) STRICT;
CREATE TABLE metadata (key TEXT PRIMARY KEY, value TEXT NOT NULL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT, WITHOUT ROWID;
CREATE TABLE robots (robot INTEGER PRIMARY KEY, name TEXT NOT NULL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE logs (robot INTEGER PRIMARY KEY, name TEXT NOT NULL, file TEXT NOT NULL, content_hash TEXT NOT NULL,
  joined_unix_ns INTEGER NOT NULL, reader_report TEXT NOT NULL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE patches (patch INTEGER PRIMARY KEY, robot INTEGER NOT NULL, stamp_ns INTEGER NOT NULL,
  island INTEGER NOT NULL, x_m REAL NOT NULL, y_m REAL NOT NULL, yaw_rad REAL NOT NULL,
  height_m REAL, height_variance_m2 REAL, left_out INTEGER NOT NULL,
  laser_x_m REAL NOT NULL, laser_y_m REAL NOT NULL, laser_yaw_rad REAL NOT NULL, roll_rad REAL, pitch_rad REAL,
  forward_m_per_sec REAL, turning_rad_per_sec REAL, sweep_secs REAL, sweep_reference REAL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE scans (patch INTEGER PRIMARY KEY, beams INTEGER NOT NULL, data BLOB NOT NULL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE relations (relation INTEGER PRIMARY KEY, from_patch INTEGER NOT NULL, to_patch INTEGER NOT NULL,
  provenance TEXT NOT NULL, state TEXT NOT NULL, retraction TEXT, x_m REAL NOT NULL, y_m REAL NOT NULL,
  yaw_rad REAL NOT NULL, c_xx REAL NOT NULL, c_xy REAL NOT NULL, c_xw REAL NOT NULL, c_yx REAL NOT NULL,
  c_yy REAL NOT NULL, c_yw REAL NOT NULL, c_wx REAL NOT NULL, c_wy REAL NOT NULL, c_ww REAL NOT NULL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE ways (way INTEGER PRIMARY KEY, from_patch INTEGER NOT NULL, to_patch INTEGER NOT NULL,
  x_m REAL, y_m REAL, yaw_rad REAL, c_xx REAL, c_xy REAL, c_xw REAL, c_yx REAL, c_yy REAL, c_yw REAL,
  c_wx REAL, c_wy REAL, c_ww REAL, rise_m REAL, distance_m REAL, rise_variance_m2 REAL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE sightings (sighting INTEGER PRIMARY KEY, patch INTEGER NOT NULL, stamp_ns INTEGER NOT NULL,
  kind TEXT NOT NULL, landmark TEXT, x_m REAL NOT NULL, y_m REAL NOT NULL, c_xx REAL NOT NULL, c_xy REAL NOT NULL,
  c_yx REAL NOT NULL, c_yy REAL NOT NULL, yaw_rad REAL, yaw_variance_rad2 REAL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE trajectory (robot INTEGER NOT NULL, scan INTEGER NOT NULL, stamp TEXT NOT NULL, stamp_ns INTEGER NOT NULL,
  patch INTEGER NOT NULL, x_m REAL NOT NULL, y_m REAL NOT NULL, yaw_rad REAL NOT NULL,
  odom_x_m REAL, odom_y_m REAL, odom_yaw_rad REAL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL, PRIMARY KEY (robot, scan)) STRICT, WITHOUT ROWID;
CREATE TABLE steps (step INTEGER PRIMARY KEY, time_unix_ns INTEGER NOT NULL, note TEXT NOT NULL,
  first_change INTEGER NOT NULL, changes INTEGER NOT NULL, scans INTEGER NOT NULL,
  negative_zeros INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;

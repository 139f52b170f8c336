-- state.db as schema version 1 made it, with one row of everything. Frozen: later versions must
-- still open it.
CREATE TABLE scenes (
  id TEXT PRIMARY KEY,
  name TEXT NOT NULL,
  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 3),
  bytes INTEGER NOT NULL,
  created_ms INTEGER NOT NULL,
  problems TEXT NOT NULL DEFAULT '[]',
  facts TEXT NOT NULL DEFAULT '{}'
) STRICT;
CREATE INDEX scenes_by_age ON scenes (created_ms, id);
CREATE INDEX scenes_by_state ON scenes (state, created_ms);
CREATE TABLE jobs (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  revision INTEGER NOT NULL DEFAULT 1,
  scene_id TEXT NOT NULL,
  name TEXT NOT NULL,
  labels TEXT NOT NULL,
  settings TEXT NOT NULL,
  priority INTEGER NOT NULL,
  state INTEGER NOT NULL DEFAULT 0 CHECK (state BETWEEN 0 AND 5),
  wanted INTEGER NOT NULL DEFAULT 0 CHECK (wanted BETWEEN 0 AND 2),
  attempt INTEGER NOT NULL DEFAULT 0,
  attempts_left INTEGER NOT NULL,
  created_ms INTEGER NOT NULL,
  started_ms INTEGER NOT NULL DEFAULT 0,
  finished_ms INTEGER NOT NULL DEFAULT 0,
  stage TEXT NOT NULL DEFAULT '',
  progress REAL NOT NULL DEFAULT 0,
  eta_sec REAL NOT NULL DEFAULT -1,
  reason TEXT NOT NULL DEFAULT '',
  hint TEXT NOT NULL DEFAULT '',
  idempotency_key TEXT UNIQUE,
  request_sha256 TEXT,
  CHECK (wanted = 0 OR state = 1)
) STRICT;
CREATE INDEX jobs_by_turn ON jobs (state, priority DESC, id);
CREATE INDEX jobs_by_scene ON jobs (scene_id, state);
CREATE TABLE events (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  at_ms INTEGER NOT NULL,
  attempt INTEGER NOT NULL,
  type TEXT NOT NULL,
  data TEXT NOT NULL
) STRICT;
CREATE INDEX events_by_job ON events (job_id, id);
CREATE INDEX events_progress ON events (job_id) WHERE type = 'progress';
CREATE TABLE outputs (
  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  name TEXT NOT NULL,
  bytes INTEGER NOT NULL,
  sha256 TEXT NOT NULL,
  content_type TEXT NOT NULL,
  updated_ms INTEGER NOT NULL,
  attempt INTEGER NOT NULL,
  PRIMARY KEY (job_id, name)
) STRICT, WITHOUT ROWID;
CREATE TABLE probe (id INTEGER PRIMARY KEY CHECK (id = 1), at_ms INTEGER NOT NULL) STRICT;
INSERT INTO scenes VALUES ('aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa', 'room', 2, 1000, 1700000000000, '[]', '{"frame_count":10}');
INSERT INTO jobs VALUES (7, 3, 'aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa', 'first', '{"who":"me"}', '{"texture_size":512}', 5, 1, 0, 2, 1,
  1700000000000, 1700000001000, 0, 'refine', 0.5, 33.5, '', '', 'key', 'abc');
INSERT INTO events VALUES (41, 7, 1700000002000, 2, 'metric', '{"series":"loss","step":1,"value":0.5}');
INSERT INTO outputs VALUES (7, 'base_color.exr', 5, 'bbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbbb', 'image/x-exr', 1700000003000, 2);
PRAGMA user_version=1;

/* schema.c -- the tables of state.db, as the steps that lead to them.
 *
 * States are the numbers of job.h's enumerations, times are Unix milliseconds, JSON is text.
 * jobs.scene_id is no foreign key: a finished job outlives its scene. Events and outputs go
 * with their job. AUTOINCREMENT keeps an event's or a job's id from ever being used again. */
#include "server/store/internal.h"

static const char step_1[] =
    "CREATE TABLE scenes ("
    "  id TEXT PRIMARY KEY,"
    "  name TEXT NOT NULL,"
    "  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 3),"
    "  bytes INTEGER NOT NULL,"
    "  created_ms INTEGER NOT NULL,"
    "  problems TEXT NOT NULL DEFAULT '[]',"
    "  facts TEXT NOT NULL DEFAULT '{}'"
    ") STRICT;"
    "CREATE INDEX scenes_by_age ON scenes (created_ms, id);"
    "CREATE INDEX scenes_by_state ON scenes (state, created_ms);"
    "CREATE TABLE jobs ("
    "  id INTEGER PRIMARY KEY AUTOINCREMENT,"
    "  revision INTEGER NOT NULL DEFAULT 1,"
    "  scene_id TEXT NOT NULL,"
    "  name TEXT NOT NULL,"
    "  labels TEXT NOT NULL,"
    "  settings TEXT NOT NULL,"
    "  priority INTEGER NOT NULL,"
    "  state INTEGER NOT NULL DEFAULT 0 CHECK (state BETWEEN 0 AND 5),"
    "  wanted INTEGER NOT NULL DEFAULT 0 CHECK (wanted BETWEEN 0 AND 2),"
    "  attempt INTEGER NOT NULL DEFAULT 0,"
    "  attempts_left INTEGER NOT NULL,"
    "  created_ms INTEGER NOT NULL,"
    "  started_ms INTEGER NOT NULL DEFAULT 0,"
    "  finished_ms INTEGER NOT NULL DEFAULT 0,"
    "  stage TEXT NOT NULL DEFAULT '',"
    "  progress REAL NOT NULL DEFAULT 0,"
    "  eta_sec REAL NOT NULL DEFAULT -1,"
    "  reason TEXT NOT NULL DEFAULT '',"
    "  hint TEXT NOT NULL DEFAULT '',"
    "  idempotency_key TEXT UNIQUE,"
    "  request_sha256 TEXT,"
    "  CHECK (wanted = 0 OR state = 1)" /* only a running job has a pending request */
    ") STRICT;"
    "CREATE INDEX jobs_by_turn ON jobs (state, priority DESC, id);"
    "CREATE INDEX jobs_by_scene ON jobs (scene_id, state);"
    "CREATE TABLE events ("
    "  id INTEGER PRIMARY KEY AUTOINCREMENT,"
    "  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,"
    "  at_ms INTEGER NOT NULL,"
    "  attempt INTEGER NOT NULL,"
    "  type TEXT NOT NULL,"
    "  data TEXT NOT NULL"
    ") STRICT;"
    "CREATE INDEX events_by_job ON events (job_id, id);"
    "CREATE INDEX events_progress ON events (job_id) WHERE type = 'progress';"
    "CREATE TABLE outputs ("
    "  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,"
    "  name TEXT NOT NULL,"
    "  bytes INTEGER NOT NULL,"
    "  sha256 TEXT NOT NULL,"
    "  content_type TEXT NOT NULL,"
    "  updated_ms INTEGER NOT NULL,"
    "  attempt INTEGER NOT NULL,"
    "  PRIMARY KEY (job_id, name)"
    ") STRICT, WITHOUT ROWID;"
    "CREATE TABLE probe (id INTEGER PRIMARY KEY CHECK (id = 1), at_ms INTEGER NOT NULL) STRICT;";

/* Users. Each user who has uploaded the bytes of a scene owns it; user 0 is nobody (rows older than tokens). */
static const char step_2[] = "CREATE TABLE users ("
                             "  id INTEGER PRIMARY KEY AUTOINCREMENT,"
                             "  name TEXT NOT NULL UNIQUE,"
                             "  created_ms INTEGER NOT NULL"
                             ") STRICT;"
                             "CREATE TABLE tokens ("
                             "  id INTEGER PRIMARY KEY AUTOINCREMENT,"
                             "  user_id INTEGER NOT NULL REFERENCES users (id),"
                             "  role INTEGER NOT NULL CHECK (role BETWEEN 0 AND 2),"
                             "  hash TEXT NOT NULL,"
                             "  created_ms INTEGER NOT NULL"
                             ") STRICT;"
                             "CREATE INDEX tokens_by_user ON tokens (user_id);"
                             "CREATE TABLE scene_owners ("
                             "  scene_id TEXT NOT NULL REFERENCES scenes (id) ON DELETE CASCADE,"
                             "  user_id INTEGER NOT NULL,"
                             "  created_ms INTEGER NOT NULL,"
                             "  PRIMARY KEY (scene_id, user_id)"
                             ") STRICT, WITHOUT ROWID;"
                             "CREATE INDEX scene_owners_by_user ON scene_owners (user_id);"
                             "INSERT INTO scene_owners SELECT id, 0, created_ms FROM scenes;"
                             "ALTER TABLE jobs ADD COLUMN owner_id INTEGER NOT NULL DEFAULT 0;"
                             "ALTER TABLE jobs ADD COLUMN shared INTEGER NOT NULL DEFAULT 0 CHECK (shared IN (0, 1));"
                             "CREATE INDEX jobs_by_owner ON jobs (owner_id, state);"
                             "CREATE INDEX jobs_shared ON jobs (scene_id) WHERE shared = 1;";

/* Resumable uploads. `received` bytes are on disk; `hash` is the state of their SHA-256; `boot` is the boot id under
 * which bytes beyond them in the file are valid, if any. */
static const char step_3[] = "CREATE TABLE uploads ("
                             "  id TEXT PRIMARY KEY,"
                             "  owner_id INTEGER NOT NULL,"
                             "  name TEXT NOT NULL,"
                             "  metadata TEXT NOT NULL,"
                             "  sha256 TEXT NOT NULL,"
                             "  length INTEGER NOT NULL,"
                             "  received INTEGER NOT NULL DEFAULT 0 CHECK (received BETWEEN 0 AND length),"
                             "  hash BLOB NOT NULL,"
                             "  boot TEXT NOT NULL,"
                             "  scene_id TEXT NOT NULL DEFAULT '',"
                             "  created_ms INTEGER NOT NULL,"
                             "  updated_ms INTEGER NOT NULL"
                             ") STRICT;"
                             "CREATE INDEX uploads_by_age ON uploads (created_ms, id);";

/* Order in the queue, the stage of a retry, the memory steps. */
static const char step_4[] = "ALTER TABLE jobs ADD COLUMN turn INTEGER NOT NULL DEFAULT 0;"
                             "ALTER TABLE jobs ADD COLUMN restart_from TEXT NOT NULL DEFAULT '';"
                             "ALTER TABLE jobs ADD COLUMN memory_step INTEGER NOT NULL DEFAULT 0;"
                             "UPDATE jobs SET turn = id;"
                             "DROP INDEX jobs_by_turn;"
                             "CREATE INDEX jobs_by_turn ON jobs (state, priority DESC, turn);"
                             "CREATE INDEX jobs_turn ON jobs (turn);";

/* Fair scheduling. */
static const char step_5[] = "CREATE TABLE usage (owner_id INTEGER PRIMARY KEY, weight REAL NOT NULL) STRICT;"
                             "DROP INDEX jobs_by_turn;"
                             "CREATE INDEX jobs_by_turn ON jobs (state, owner_id, priority DESC, turn);";

/* Retention. */
static const char step_6[] = "ALTER TABLE scenes ADD COLUMN pinned INTEGER NOT NULL DEFAULT 0 CHECK (pinned IN (0, 1));"
                             "ALTER TABLE scenes ADD COLUMN expires_ms INTEGER NOT NULL DEFAULT 0;"
                             "ALTER TABLE jobs ADD COLUMN pinned INTEGER NOT NULL DEFAULT 0 CHECK (pinned IN (0, 1));"
                             "ALTER TABLE jobs ADD COLUMN expires_ms INTEGER NOT NULL DEFAULT 0;"
                             "CREATE TABLE retention ("
                             "  id INTEGER PRIMARY KEY CHECK (id = 1),"
                             "  scene_ms INTEGER NOT NULL,"
                             "  job_ms INTEGER NOT NULL,"
                             "  upload_ms INTEGER NOT NULL"
                             ") STRICT;"
                             "INSERT INTO retention VALUES (1, 0, 0, 86400000);";

/* Pruned events: a job's events up to pruned_id are gone; events_gone when only the last is left, long after the
 * job's end. `pruned` has the highest id ever pruned. */
static const char step_7[] =
    "ALTER TABLE jobs ADD COLUMN pruned_id INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE jobs ADD COLUMN events_gone INTEGER NOT NULL DEFAULT 0;"
    "CREATE INDEX jobs_by_end ON jobs (events_gone, finished_ms);"
    "CREATE TABLE pruned (id INTEGER PRIMARY KEY CHECK (id = 1), event_id INTEGER NOT NULL) STRICT;"
    "INSERT INTO pruned VALUES (1, 0);";

/* Webhooks of jobs, and their queued messages. */
static const char step_8[] = "CREATE TABLE webhooks ("
                             "  job_id INTEGER PRIMARY KEY REFERENCES jobs (id) ON DELETE CASCADE,"
                             "  url TEXT NOT NULL,"
                             "  secret TEXT NOT NULL"
                             ") STRICT;"
                             "CREATE TABLE outbox ("
                             "  id INTEGER PRIMARY KEY AUTOINCREMENT,"
                             "  job_id INTEGER NOT NULL,"
                             "  url TEXT NOT NULL,"
                             "  secret TEXT NOT NULL,"
                             "  body TEXT NOT NULL,"
                             "  tries INTEGER NOT NULL DEFAULT 0,"
                             "  next_ms INTEGER NOT NULL"
                             ") STRICT;"
                             "CREATE INDEX outbox_by_time ON outbox (next_ms);";

/* How long an upload is kept, as for scenes and jobs. */
static const char step_9[] =
    "ALTER TABLE uploads ADD COLUMN pinned INTEGER NOT NULL DEFAULT 0 CHECK (pinned IN (0, 1));"
    "ALTER TABLE uploads ADD COLUMN expires_ms INTEGER NOT NULL DEFAULT 0;";

/* Disk space of the folders of scenes and jobs; -1: unknown. */
static const char step_10[] = "ALTER TABLE scenes ADD COLUMN disk_bytes INTEGER NOT NULL DEFAULT -1;"
                              "ALTER TABLE jobs ADD COLUMN disk_bytes INTEGER NOT NULL DEFAULT -1;"
                              "DROP INDEX jobs_by_owner;"
                              "CREATE INDEX jobs_by_owner ON jobs (owner_id, state, disk_bytes);";

/* Each owner has his own name for a scene. */
static const char step_11[] = "ALTER TABLE scene_owners ADD COLUMN name TEXT NOT NULL DEFAULT '';"
                              "UPDATE scene_owners SET name = (SELECT name FROM scenes WHERE id = scene_id);"
                              "ALTER TABLE scenes DROP COLUMN name;";

/* Lists of scenes are ordered by when each owner uploaded them. */
static const char step_12[] = "DROP INDEX scenes_by_age;";

/* The SHA-256 that the daemon computed of an output ("": not yet), and of which version of the file. Existing outputs
 * are hashed when first requested. */
static const char step_13[] =
    "ALTER TABLE outputs ADD COLUMN digest TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE outputs ADD COLUMN digest_inode INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE outputs ADD COLUMN digest_bytes INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE outputs ADD COLUMN digest_modified_ns INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE outputs ADD COLUMN digest_changed_ns INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE outputs ADD COLUMN digest_wanted INTEGER NOT NULL DEFAULT 0 CHECK (digest_wanted IN (0, 1));"
    "CREATE INDEX outputs_to_hash ON outputs (bytes) WHERE digest_wanted = 1;";

/* An upload of which nothing has arrived reserves its space for minutes, not hours. */
static const char step_14[] = "ALTER TABLE retention ADD COLUMN empty_upload_ms INTEGER NOT NULL DEFAULT 600000;";

/* The outcome of a job's webhook. */
static const char step_15[] =
    "ALTER TABLE webhooks ADD COLUMN result TEXT NOT NULL DEFAULT '';" /* last message: delivered, failed or gave_up */
    "ALTER TABLE webhooks ADD COLUMN attempts INTEGER NOT NULL DEFAULT 0;" /* of that message */
    "ALTER TABLE webhooks ADD COLUMN status INTEGER NOT NULL DEFAULT 0;"   /* the HTTP status; 0: none */
    "ALTER TABLE webhooks ADD COLUMN error TEXT NOT NULL DEFAULT '';"
    "ALTER TABLE webhooks ADD COLUMN at_ms INTEGER NOT NULL DEFAULT 0;"
    "CREATE INDEX outbox_by_job ON outbox (job_id);";

/* How a scene is to be read, as its users give it (common/reading.h), from the upload on. */
static const char step_16[] = "ALTER TABLE scenes ADD COLUMN reading TEXT NOT NULL DEFAULT '{}';"
                              "ALTER TABLE uploads ADD COLUMN reading TEXT NOT NULL DEFAULT '';";

/* Attempts, the durable part of them (attempts.h). `part` is for jobs that split (step 24). All files of a job of an
 * earlier version lie in one folder, which becomes that of its last attempt. */
static const char step_17[] = "CREATE TABLE attempts ("
                              "  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,"
                              "  part INTEGER NOT NULL DEFAULT 0,"
                              "  number INTEGER NOT NULL CHECK (number > 0),"
                              "  executor TEXT NOT NULL,"
                              "  phase INTEGER NOT NULL CHECK (phase BETWEEN 0 AND 2),"
                              "  ending TEXT NOT NULL DEFAULT '',"
                              "  PRIMARY KEY (job_id, part, number)"
                              ") STRICT, WITHOUT ROWID;"
                              "CREATE INDEX attempts_by_phase ON attempts (phase) WHERE phase < 2;"
                              "INSERT INTO attempts (job_id, number, executor, phase)"
                              " SELECT id, attempt, 'process', 0 FROM jobs WHERE attempt > 0;"
                              "UPDATE outputs SET attempt = (SELECT attempt FROM jobs WHERE id = job_id);";

/* CPU time by months. What was used before is not known by month. */
static const char step_18[] = "CREATE TABLE usage_months ("
                              "  owner_id INTEGER NOT NULL,"
                              "  month TEXT NOT NULL," /* "2026-01", UTC */
                              "  cpu_sec REAL NOT NULL,"
                              "  PRIMARY KEY (owner_id, month)"
                              ") STRICT, WITHOUT ROWID;";

/* Attempts that run elsewhere (remote.h), what their nodes have reported and nobody has read yet, and where a job is to
 * run ("": wherever there is a place). */
static const char step_19[] = "CREATE TABLE remote ("
                              "  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,"
                              "  part INTEGER NOT NULL DEFAULT 0,"
                              "  number INTEGER NOT NULL,"
                              "  executor TEXT NOT NULL,"
                              "  name TEXT NOT NULL UNIQUE," /* the site's name of it */
                              "  phase INTEGER NOT NULL CHECK (phase BETWEEN 0 AND 3),"
                              "  external_id TEXT NOT NULL DEFAULT '',"
                              "  external_reason TEXT NOT NULL DEFAULT '',"
                              "  token_sha256 TEXT NOT NULL,"
                              "  claimant TEXT NOT NULL DEFAULT ''," /* the one that claimed it */
                              "  host TEXT NOT NULL DEFAULT '',"
                              "  lease_sec INTEGER NOT NULL,"
                              "  begun_ms INTEGER NOT NULL,"             /* Unix time; 0: not yet, likewise below */
                              "  claimed_ms INTEGER NOT NULL DEFAULT 0," /* from here on it runs, before it waits */
                              "  heard_ms INTEGER NOT NULL DEFAULT 0,"
                              "  heard_count INTEGER NOT NULL DEFAULT 0,"
                              "  refused_count INTEGER NOT NULL DEFAULT 0," /* claims by others */
                              "  last_seq INTEGER NOT NULL DEFAULT 0,"
                              "  wanted INTEGER NOT NULL DEFAULT 0,"
                              "  told_seq INTEGER NOT NULL DEFAULT 0," /* whose reply carried `wanted` first; 0: none */
                              "  cpu_sec REAL NOT NULL DEFAULT 0,"
                              "  end_way TEXT NOT NULL DEFAULT '',"
                              "  end_code INTEGER NOT NULL DEFAULT 0,"
                              "  end_reason TEXT NOT NULL DEFAULT '',"
                              "  end_words TEXT NOT NULL DEFAULT '',"
                              "  PRIMARY KEY (job_id, part, number)"
                              ") STRICT, WITHOUT ROWID;"
                              "CREATE INDEX remote_by_phase ON remote (executor, phase) WHERE phase < 3;"
                              "CREATE TABLE attempt_lines ("
                              "  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,"
                              "  part INTEGER NOT NULL DEFAULT 0,"
                              "  number INTEGER NOT NULL,"
                              "  seq INTEGER NOT NULL,"
                              "  lines TEXT NOT NULL," /* of one report, each with its newline */
                              "  PRIMARY KEY (job_id, part, number, seq)"
                              ") STRICT;"
                              "ALTER TABLE jobs ADD COLUMN executor TEXT NOT NULL DEFAULT '';";

/* Kinds of jobs (job.h), the job that another one reads, and the files that come with a job; bytes -1: still to be
 * sent. */
static const char step_20[] =
    "ALTER TABLE jobs ADD COLUMN kind INTEGER NOT NULL DEFAULT 0 CHECK (kind BETWEEN 0 AND 2);"
    "ALTER TABLE jobs ADD COLUMN source_id INTEGER NOT NULL DEFAULT 0;"
    "ALTER TABLE jobs ADD COLUMN cost REAL NOT NULL DEFAULT 0;"
    "CREATE INDEX jobs_by_source ON jobs (source_id, state) WHERE source_id > 0;"
    "CREATE TABLE job_files ("
    "  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,"
    "  name TEXT NOT NULL,"
    "  bytes INTEGER NOT NULL DEFAULT -1,"
    "  sha256 TEXT NOT NULL DEFAULT '',"
    "  PRIMARY KEY (job_id, name)"
    ") STRICT, WITHOUT ROWID;";

/* The labels of jobs, to find jobs by. Triggers copy them from jobs.labels, which nothing else has to know. */
static const char step_21[] =
    "CREATE TABLE job_labels ("
    "  label TEXT NOT NULL,"
    "  value TEXT NOT NULL,"
    "  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,"
    "  PRIMARY KEY (label, value, job_id)"
    ") STRICT, WITHOUT ROWID;"
    "CREATE INDEX job_labels_by_job ON job_labels (job_id);"
    "CREATE TRIGGER job_labels_of_new AFTER INSERT ON jobs WHEN new.labels <> '{}' BEGIN"
    "  INSERT OR IGNORE INTO job_labels SELECT key, value, new.id FROM json_each(new.labels);"
    "END;"
    "CREATE TRIGGER job_labels_of_changed AFTER UPDATE OF labels ON jobs WHEN new.labels <> old.labels BEGIN"
    "  DELETE FROM job_labels WHERE job_id = new.id;"
    "  INSERT OR IGNORE INTO job_labels SELECT key, value, new.id FROM json_each(new.labels);"
    "END;"
    "INSERT OR IGNORE INTO job_labels SELECT key, value, jobs.id FROM jobs, json_each(jobs.labels);";

/* Queued jobs that must run on a certain executor: a round of the scheduler looks for those whose executor is gone. */
static const char step_22[] = "CREATE INDEX jobs_by_executor ON jobs (executor) WHERE state = 0 AND executor <> '';";

/* Tokens that end by themselves; 0: never. */
static const char step_23[] = "ALTER TABLE tokens ADD COLUMN expires_ms INTEGER NOT NULL DEFAULT 0;";

/* Parts of renders (parts.h). States: open, done, failed, blocked. */
static const char step_24[] = "CREATE TABLE parts ("
                              "  job_id INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,"
                              "  part INTEGER NOT NULL CHECK (part > 0),"
                              "  first INTEGER NOT NULL,"
                              "  count INTEGER NOT NULL CHECK (count > 0)," /* of pictures */
                              "  digest TEXT NOT NULL,"
                              "  state INTEGER NOT NULL DEFAULT 0 CHECK (state BETWEEN 0 AND 3),"
                              "  crashes INTEGER NOT NULL DEFAULT 0,"
                              "  done REAL NOT NULL DEFAULT 0," /* pictures */
                              "  rate REAL NOT NULL DEFAULT 0," /* pictures a second; 0: unknown */
                              "  reason TEXT NOT NULL DEFAULT '',"
                              "  hint TEXT NOT NULL DEFAULT '',"
                              "  PRIMARY KEY (job_id, part)"
                              ") STRICT, WITHOUT ROWID;";

const char *const schema_steps[] = {step_1,  step_2,  step_3,  step_4,  step_5,  step_6,  step_7,  step_8,
                                    step_9,  step_10, step_11, step_12, step_13, step_14, step_15, step_16,
                                    step_17, step_18, step_19, step_20, step_21, step_22, step_23, step_24};
const int schema_version = (int)(sizeof schema_steps / sizeof schema_steps[0]);

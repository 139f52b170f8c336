/* contents.c -- see contents.h. */
#include "server/store/contents.h"

#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/job/job.h"
#include "server/store/sql.h"
#include "server/store/store.h"

static enum status read_scenes(struct contents *c, struct sql *sql, struct error *err) {
    sqlite3_stmt *stmt;
    enum status status = sql_query(sql, &stmt, err, "SELECT id, state FROM scenes ORDER BY id", "");
    while (sql_next(sql, stmt, &status, err)) {
        c->scenes = mem_realloc_array(c->scenes, c->scene_count + 1, sizeof *c->scenes);
        struct contents_scene *scene = &c->scenes[c->scene_count++];
        snprintf(scene->id, sizeof scene->id, "%s", sql_text(stmt, 0));
        scene->is_ready = sqlite3_column_int(stmt, 1) == (int)SCENE_READY;
    }
    return status;
}

static enum status read_jobs(struct contents *c, struct sql *sql, struct error *err) {
    sqlite3_stmt *stmt;
    enum status status = sql_query(sql, &stmt, err, "SELECT id, state, attempt FROM jobs ORDER BY id", "");
    while (sql_next(sql, stmt, &status, err)) {
        enum job_state state = (enum job_state)sqlite3_column_int(stmt, 1);
        c->jobs = mem_realloc_array(c->jobs, c->job_count + 1, sizeof *c->jobs);
        c->jobs[c->job_count++] = (struct contents_job){.id = sqlite3_column_int64(stmt, 0),
                                                        .attempt = sqlite3_column_int(stmt, 2),
                                                        .is_running = state == JOB_RUNNING,
                                                        .is_terminal = job_is_terminal(state)};
    }
    return status;
}

static enum status read_outputs(struct contents *c, struct sql *sql, struct error *err) {
    sqlite3_stmt *stmt;
    size_t job = 0;
    enum status status = sql_query(
        sql, &stmt, err, "SELECT job_id, name, bytes, sha256, attempt FROM outputs ORDER BY job_id, name", "");
    while (sql_next(sql, stmt, &status, err)) {
        int64_t id = sqlite3_column_int64(stmt, 0);
        while (job < c->job_count && c->jobs[job].id < id)
            job++;
        if (job == c->job_count || c->jobs[job].id != id)
            continue; /* an output of no job: foreign keys rule it out */
        if (c->jobs[job].count++ == 0)
            c->jobs[job].first = c->output_count;
        c->outputs = mem_realloc_array(c->outputs, c->output_count + 1, sizeof *c->outputs);
        struct contents_output *output = &c->outputs[c->output_count++];
        output->name = sql_dup(stmt, 1);
        output->bytes = (uint64_t)sqlite3_column_int64(stmt, 2);
        output->attempt = sqlite3_column_int(stmt, 4);
        snprintf(output->sha256, sizeof output->sha256, "%s", sql_text(stmt, 3));
    }
    return status;
}

enum status contents_read(struct contents *c, const char *path, struct error *err) {
    struct sql sql;
    memset(c, 0, sizeof *c);
    enum status status = sql_open(&sql, path, SQL_ROLLBACK, 0, err);
    if (status != STATUS_OK)
        return status;
    status = read_scenes(c, &sql, err);
    if (status == STATUS_OK)
        status = read_jobs(c, &sql, err);
    if (status == STATUS_OK)
        status = read_outputs(c, &sql, err);
    sql_close(&sql);
    return status;
}

void contents_release(struct contents *c) {
    for (size_t i = 0; i < c->output_count; i++)
        mem_free(c->outputs[i].name);
    mem_free(c->scenes);
    mem_free(c->jobs);
    mem_free(c->outputs);
    memset(c, 0, sizeof *c);
}

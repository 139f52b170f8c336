/* resume.c -- see resume.h. */
#include "server/job/resume.h"

#include "common/mem.h"

#define RUNNING_MAX 10000 /* attempts that an earlier daemon may have left running */

struct resume {
    struct attempt *slots;
    size_t count;
    struct executors *places;
    const struct scheduler_config *config;
    struct store *store;
};

/* Takes up the attempts that go on without a daemon. Fills kept[*count] with them. */
static enum status resume_jobs(struct resume *s, struct attempt_key *kept, size_t *count, struct error *err) {
    size_t running = 0;
    struct running *list = mem_array(RUNNING_MAX, sizeof *list);
    *count = 0;
    enum status status = store_job_running(s->store, RUNNING_MAX, list, &running, err);
    for (size_t i = 0; i < running && *count < s->count && status == STATUS_OK; i++) {
        struct scheduler_config with = *s->config;
        struct attempt_row row = {0};
        if (list[i].key.number == 0)
            continue;
        status = store_attempt_get(s->store, &list[i].key, &row, err);
        const struct executor_use *place = status == STATUS_OK ? executors_find(s->places, row.executor) : NULL;
        if (status != STATUS_OK || !place)
            continue;
        with.executor = place->executor;
        status = attempt_resume_job(&s->slots[*count], &with, s->store, &list[i].key, err);
        if (status == STATUS_OK)
            kept[(*count)++] = list[i].key;
        status = status == STATUS_NOT_FOUND ? STATUS_OK : status;
    }
    mem_free(list);
    return status;
}

enum status resume_all(struct attempt *slots, size_t slot_count, struct executors *places,
                       const struct scheduler_config *config, struct store *store, size_t *requeued,
                       struct error *err) {
    struct resume all = {slots, slot_count, places, config, store};
    struct attempt_key *kept = mem_array(slot_count, sizeof *kept);
    size_t count;
    enum status status = resume_jobs(&all, kept, &count, err);
    if (status == STATUS_OK)
        status = store_reconcile(store, kept, count, requeued, err);
    mem_free(kept);
    return status;
}

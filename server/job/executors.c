/* executors.c -- see executors.h. */
#include "server/job/executors.h"

#include <string.h>

#include "common/mem.h"

#define NAMES_MAX 4096 /* bytes of all names: 64 executors */

static void add(struct executors *p, const struct executor *executor, int limit, bool is_for_others) {
    p->use = mem_realloc_array(p->use, p->count + 1, sizeof *p->use);
    p->use[p->count] = (struct executor_use){
        .executor = executor, .limit = (size_t)(limit > 0 ? limit : 1), .is_for_others = is_for_others};
    p->slots += p->use[p->count++].limit;
}

void executors_init(struct executors *p, const struct scheduler_config *config) {
    bool has_here = false;
    *p = (struct executors){0};
    for (size_t i = 0; i < config->place_count; i++) {
        bool is_here = config->places[i] == config->executor;
        add(p, config->places[i], is_here ? config->max_running : config->places[i]->max_running, false);
        has_here |= is_here;
    }
    if (!has_here)
        add(p, config->executor, config->max_running, config->place_count > 0);
}

void executors_release(struct executors *p) {
    mem_free(p->use);
    *p = (struct executors){0};
}

void executors_count(struct executors *p, const struct attempt *slots, size_t count) {
    for (size_t i = 0; i < p->count; i++) {
        p->use[i].running = 0;
        p->use[i].is_closed = false;
        for (size_t k = 0; k < count; k++)
            p->use[i].running += slots[k].phase != ATTEMPT_EMPTY && slots[k].executor == p->use[i].executor;
    }
}

struct executor_use *executors_find(struct executors *p, const char *name) {
    for (size_t i = 0; i < p->count; i++)
        if (strcmp(p->use[i].executor->name, name) == 0)
            return &p->use[i];
    return NULL;
}

static bool is_free(const struct executor_use *place) { return !place->is_closed && place->running < place->limit; }

struct executor_use *executors_for(struct executors *p, const char *chosen) {
    for (size_t i = 0; i < p->count; i++)
        if (is_free(&p->use[i]) &&
            ((!*chosen && !p->use[i].is_for_others) || strcmp(p->use[i].executor->name, chosen) == 0))
            return &p->use[i];
    return NULL;
}

static char *list_names(const struct executors *p, bool all) {
    struct buf names;
    buf_init(&names, NAMES_MAX);
    for (size_t i = 0; i < p->count; i++)
        if (all || is_free(&p->use[i]))
            buf_printf(&names, "%s%s ", names.length ? "" : " ", p->use[i].executor->name);
    char *text = names.length ? mem_strdup(buf_text(&names)) : NULL;
    buf_release(&names);
    return text;
}

char *executors_names(const struct executors *p) { return list_names(p, true); }

char *executors_available(const struct executors *p) { return list_names(p, false); }

void executors_add(struct executors *p, const struct executor *executor) {
    for (size_t i = 0; i < p->count; i++)
        p->use[i].running += executor && p->use[i].executor == executor;
}

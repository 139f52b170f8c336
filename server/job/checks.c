/* checks.c -- see checks.h. */
#include "server/job/checks.h"

#include <string.h>

#include "common/mem.h"

/* The clock when a check of that user last began; 0: long ago. */
static uint64_t begun(const struct checks *c, int64_t owner_id) {
    for (size_t i = 0; i < c->count; i++)
        if (c->last[i].owner_id == owner_id)
            return c->last[i].begun;
    return 0;
}

static void note(struct checks *c, int64_t owner_id) {
    size_t at = 0;
    while (at < c->count && c->last[at].owner_id != owner_id)
        at++;
    if (at == c->count && c->count < CHECKS_USERS)
        c->count++;
    else if (at == c->count) { /* Forget the user whose turn is longest past. */
        at = 0;
        for (size_t i = 1; i < c->count; i++)
            at = c->last[i].begun < c->last[at].begun ? i : at;
    }
    c->last[at].owner_id = owner_id;
    c->last[at].begun = ++c->clock;
}

/* Chooses from list[count] the scene to check next; NULL: none may start. busy[busy_count] are being checked, in
 * `slots` slots. */
static const struct unchecked *choose(const struct checks *c, const struct unchecked *list, size_t count,
                                      const struct unchecked *busy, size_t busy_count, size_t slots) {
    const struct unchecked *best = NULL;
    for (size_t i = 0; i < count; i++) {
        size_t running = 0;
        for (size_t k = 0; k < busy_count; k++)
            running += busy[k].owner_id == list[i].owner_id;
        if (running > 0 && running + 1 >= slots)
            continue;
        if (!best || begun(c, list[i].owner_id) < begun(c, best->owner_id))
            best = &list[i];
    }
    return best;
}

enum status checks_next(struct checks *c, struct store *store, const struct attempt *slots, size_t count,
                        struct unchecked *next, struct error *err) {
    struct unchecked *list = mem_array(CHECKS_USERS, sizeof *list), *busy = mem_calloc(count, sizeof *busy);
    size_t found = 0, busy_count = 0;
    for (size_t i = 0; i < count; i++) {
        if (slots[i].phase == ATTEMPT_EMPTY)
            continue;
        memcpy(busy[busy_count].id, slots[i].scene_id, SCENE_ID_SIZE);
        busy[busy_count++].owner_id = slots[i].owner_id;
    }
    enum status status = store_scene_unchecked(store, busy, busy_count, CHECKS_USERS, list, &found, err);
    const struct unchecked *best = status == STATUS_OK ? choose(c, list, found, busy, busy_count, count) : NULL;
    if (best) {
        *next = *best;
        note(c, next->owner_id);
    } else if (status == STATUS_OK) {
        status = error_set(err, STATUS_NOT_FOUND, "no scene waits to be checked");
    }
    mem_free(list);
    mem_free(busy);
    return status;
}

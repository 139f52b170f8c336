/* scene_check.c -- see scene_check.h. */
#include "server/check/scene_check.h"

#include "common/clock.h"
#include "common/mem.h"
#include "server/scene/photograph_reduce.h"

static enum status load(struct scene_check *room, const char *dir, const struct bundle_limits *limits,
                        struct parallel *pool, cJSON *problems, struct error *err) {
    double begin = clock_sec();
    struct bundle_limits reduced = *limits;
    reduced.kept_pixels = REDUCED_MAX_PIXELS; /* they tell as well whether mesh and photographs fit */
    enum status status = bundle_load(dir, &room->reading, &reduced, pool, &room->scene, problems, err);
    room->load_sec += clock_sec() - begin;
    if (status == STATUS_OK && room->read)
        room->read(room->user, &room->scene);
    begin = clock_sec();
    if (status == STATUS_OK)
        status = accel_new(&room->accel, &room->scene.mesh, pool, err);
    if (status == STATUS_OK)
        fit_judge(&room->fit, &room->scene, room->accel, pool);
    room->fit_sec += clock_sec() - begin;
    return status;
}

static void unload(struct scene_check *room) {
    accel_free(room->accel);
    room->accel = NULL;
    scene_release(&room->scene);
    fit_release(&room->fit);
}

/* Whether the remedy leaves alone what the user has said. */
static bool respects(const struct reading *remedy, const struct reading *given) {
    cJSON *new = reading_json(remedy), *old = reading_json(given), *member;
    bool respected = true;
    cJSON_ArrayForEach(member, old) {
        const cJSON *other = cJSON_GetObjectItemCaseSensitive(new, member->string);
        respected = respected && other && cJSON_Compare(other, member, true);
    }
    cJSON_Delete(new);
    cJSON_Delete(old);
    return respected;
}

/* Where the bundle cannot be read by the remedy (coordinates out of range, say), it is read as it was given again. */
static enum status give_back(struct scene_check *room, const char *dir, const struct bundle_limits *limits,
                             struct parallel *pool, cJSON *problems, struct error *err) {
    unload(room);
    fit_release(&room->given);
    reading_release(&room->reading);
    room->reading = room->given_reading;
    room->given_reading = reading_default();
    room->was_taken = false;
    return load(room, dir, limits, pool, problems, err);
}

static enum status take(struct scene_check *room, const char *dir, const struct bundle_limits *limits,
                        struct parallel *pool, cJSON *problems, struct error *err) {
    struct reading remedy = hypothesis_reading(&room->fit.search.best, &room->reading);
    if (!respects(&remedy, &room->reading)) {
        reading_release(&remedy);
        return STATUS_OK;
    }
    cJSON *ignored = cJSON_CreateArray();
    room->given = room->fit;
    room->fit = (struct fit_result){0};
    room->given_reading = room->reading;
    room->reading = remedy;
    room->was_taken = true;
    unload(room);
    enum status status = load(room, dir, limits, pool, ignored, err);
    cJSON_Delete(ignored);
    bool is_unreadable = status == STATUS_INPUT || status == STATUS_LIMIT;
    return is_unreadable ? give_back(room, dir, limits, pool, problems, err) : status;
}

enum status scene_check(struct scene_check *room, const char *dir, const struct reading *reading,
                        const struct bundle_limits *limits, struct parallel *pool, cJSON *problems,
                        scene_check_read *read, void *user, struct error *err) {
    *room = (struct scene_check){
        .reading = reading_copy(reading), .given_reading = reading_default(), .read = read, .user = user};
    enum status status = load(room, dir, limits, pool, problems, err);
    if (status == STATUS_OK && room->fit.is_overwhelming)
        status = take(room, dir, limits, pool, problems, err);
    return status;
}

void scene_check_release(struct scene_check *room) {
    unload(room);
    fit_release(&room->given);
    reading_release(&room->given_reading);
    reading_release(&room->reading);
}

void scene_check_facts(const struct scene_check *room, cJSON *facts) {
    cJSON *fit = fit_json(&room->fit, &room->reading);
    if (room->was_taken) { /* the remedy is that of the scene as it was given */
        cJSON *given = fit_json(&room->given, &room->given_reading), *evidence;
        evidence = cJSON_GetObjectItemCaseSensitive(fit, "evidence");
        for (size_t i = room->given.evidence_count; i-- > 0;) {
            char *text = mem_printf("as it was given: %s", room->given.evidence[i]);
            cJSON_InsertItemInArray(evidence, 0, json_new_string(text));
            mem_free(text);
        }
        if (!room->fit.has_remedy) {
            cJSON_ReplaceItemInObjectCaseSensitive(fit, "remedy",
                                                   cJSON_DetachItemFromObjectCaseSensitive(given, "remedy"));
            cJSON_ReplaceItemInObjectCaseSensitive(fit, "remedy_text",
                                                   cJSON_DetachItemFromObjectCaseSensitive(given, "remedy_text"));
        }
        cJSON_Delete(given);
    }
    json_add_bool(fit, "taken", room->was_taken);
    json_add(facts, "fit", fit);
    json_add(facts, "reading", reading_json(&room->reading));
}

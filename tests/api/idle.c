/* idle -- the HTTP side over a store that no scheduler moves, for shell tests. Prints its address
 * the id of a scene that is ready and its data folder; then reads commands, one a line, and answers each "ok" or
 * with an error's message:
 *
 *   start JOB | succeed JOB ATTEMPT | fail JOB ATTEMPT | stop JOB ATTEMPT
 *   tell FACTS | ready FACTS | reject PROBLEMS (of the scene: facts while it is checked, the check's end)
 *
 * Ends with its input. */
#include "tests/api/rig.h"

static enum status obey(struct rig *rig, const char *line, struct error *err) {
    char word[16];
    long long job;
    int attempt = 0;
    if (strncmp(line, "ready ", 6) == 0)
        return store_scene_ready(rig->store, RIG_SCENE, NULL, line + 6, err);
    if (strncmp(line, "tell ", 5) == 0)
        return store_scene_set_facts(rig->store, RIG_SCENE, NULL, line + 5, err);
    if (strncmp(line, "reject ", 7) == 0)
        return store_scene_reject(rig->store, RIG_SCENE, NULL, line + 7, "{}", err);
    int count = sscanf(line, "%15s %lld %d", word, &job, &attempt);
    if (count == 2 && strcmp(word, "start") == 0)
        return store_job_start(rig->store, job, "process", &attempt, err);
    if (count == 3 && strcmp(word, "succeed") == 0)
        return store_job_succeed(rig->store, job, attempt, "", err);
    if (count == 3 && strcmp(word, "fail") == 0)
        return store_job_fail(rig->store, job, attempt, "it broke", "mend it", err);
    if (count == 3 && strcmp(word, "stop") == 0)
        return store_job_stop(rig->store, job, attempt, "", err);
    return error_set(err, STATUS_INPUT, "what is \"%s\"?", line);
}

int main(void) {
    struct rig rig;
    struct error err;
    char line[4096];
    rig_start(&rig, &rig_patient, 15);
    rig_scene(&rig);
    printf("http://127.0.0.1:%u %s %s\n", listener_port(rig.listener), RIG_SCENE, rig.dir);
    fflush(stdout);
    while (fgets(line, sizeof line, stdin)) {
        line[strcspn(line, "\n")] = '\0';
        puts(obey(&rig, line, &err) == STATUS_OK ? "ok" : err.message);
        fflush(stdout);
    }
    rig_stop(&rig);
    return 0;
}

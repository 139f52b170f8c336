/* test_node_fetch.c -- a node that is to stop while it fetches stops at once, not after the file: a list that the
 * daemon still makes, a file of the scene, a part of the checkpoint. The daemon is a server that follows a script and
 * falls silent; then the machine's scheduler sends SIGTERM. */
#include "server/node/fetch.h"
#include "tests/unit/client_script.h"

#define LETTER_A "ca978112ca1bbdcafac231b39a23dc4da786eff8147c4f72b9807785afee48bb" /* the SHA-256 of "a" */
#define SCENE_LIST                                                                                                     \
    "{\"scene_id\":\"" LETTER_A "\",\"files\":[{\"name\":\"mesh.ply\",\"bytes\":900,\"sha256\":\"" LETTER_A "\"}]}"
#define PART_LIST "{\"files\":[{\"name\":\"part-1\",\"bytes\":900,\"sha256\":\"" LETTER_A "\"}]}"

/* Waits until the script has fallen silent. */
static void *take_machine_back(void *script) {
    char byte;
    CHECK(read(((struct script *)script)->hanging[0], &byte, 1) == 1);
    CHECK(kill(getpid(), SIGTERM) == 0);
    return NULL;
}

/* Fetches the scene, or the checkpoint, until the script falls silent. */
static void check_stop(struct script *s, const char *name, bool is_scene) {
    struct error err = {0};
    struct relay relay;
    struct cached_scene scene = {.use_fd = -1};
    pthread_t thread;
    script_start(s);
    CHECK(pthread_create(&thread, NULL, take_machine_back, s) == 0);
    char *url = mem_printf("http://127.0.0.1:%d", s->port), *cache = file_join(root, name);
    const struct link_config config = {.url = url, .token = "secret", .job_id = 7, .number = 1};
    relay_init(&relay, &config);
    enum status status =
        is_scene ? fetch_scene(&relay, cache, 1 << 30, &scene, &err) : fetch_checkpoint(&relay, root, &err);
    pthread_join(thread, NULL);
    CHECK_THAT(status == STATUS_CANCELLED, "%s: %s", name, status_name(status));
    CHECK_STRING(err.message, "stopped before it began");
    CHECK(relay.is_taken_back);
    cached_scene_release(&scene);
    relay_release(&relay);
    script_end(s, name);
    mem_free(cache);
    mem_free(url);
}

int main(void) {
    struct script s = {0};
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    CHECK(pthread_sigmask(SIG_BLOCK, &set, NULL) == 0);
    CHECK(mkdtemp(root) != NULL);

    add_step(&s, HANG, "GET /v1/attempts/7/1/scene ", NULL, NULL);
    check_stop(&s, "list", true);

    add_reply(&s, "200 OK", "", SCENE_LIST, "GET /v1/attempts/7/1/scene ", NULL, NULL);
    add_step(&s, HANG, "GET /v1/attempts/7/1/scene/mesh.ply ", NULL, NULL);
    check_stop(&s, "scene", true);

    add_reply(&s, "200 OK", "", PART_LIST, "GET /v1/attempts/7/1/checkpoint ", NULL, NULL);
    add_step(&s, HANG, "GET /v1/attempts/7/1/checkpoint/part-1 ", NULL, NULL);
    check_stop(&s, "checkpoint", false);

    file_remove_tree(root, NULL);
    return check_result();
}

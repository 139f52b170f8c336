/* test_one_key.c -- many parallel creates with one idempotency key: exactly one job, and everybody
 * is told the same one. */
#include <pthread.h>

#include "tests/api/rig.h"
#include "tests/figures.h"

#define CLIENTS_MAX 100

struct client {
    struct rig *rig;
    pthread_barrier_t *start;
    int round, status;
    long long job;
};

static void *create(void *user) {
    struct client *c = user;
    struct buf reply;
    char *request = mem_printf("POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
                               "Content-Type: application/json\r\nIdempotency-Key: round-%d\r\n"
                               "Content-Length: %zu\r\n\r\n{\"scene\":\"" RIG_SCENE "\"}",
                               c->round, strlen("{\"scene\":\"" RIG_SCENE "\"}"));
    int fd = rig_connect(c->rig);
    buf_init(&reply, 1 << 20);
    pthread_barrier_wait(c->start);
    rig_send(fd, request, strlen(request));
    rig_receive(fd, &reply, NULL);
    close(fd);
    c->status = rig_status(&reply);
    if (sscanf(rig_body(&reply), "{\"id\":%lld", &c->job) != 1)
        c->job = -1;
    buf_release(&reply);
    mem_free(request);
    return NULL;
}

int main(void) {
    struct rig rig;
    struct error err;
    struct store_counts counts;
    struct client client[CLIENTS_MAX];
    int clients = (int)figures_count("UNBAKE_CLIENTS", 10, CLIENTS_MAX);
    int rounds = (int)figures_count("UNBAKE_ROUNDS", 3, 40);
    clients = clients < CLIENTS_MAX ? clients : CLIENTS_MAX;
    rig_start(&rig, &rig_patient, 60);
    rig_scene(&rig);
    for (int round = 0; round < rounds; round++) {
        pthread_t thread[CLIENTS_MAX];
        pthread_barrier_t start;
        pthread_barrier_init(&start, NULL, (unsigned)clients);
        for (int i = 0; i < clients; i++) {
            client[i] = (struct client){.rig = &rig, .start = &start, .round = round};
            pthread_create(&thread[i], NULL, create, &client[i]);
        }
        int made = 0;
        for (int i = 0; i < clients; i++) {
            pthread_join(thread[i], NULL);
            CHECK_THAT(client[i].status == 200 || client[i].status == 201, "status %d", client[i].status);
            made += client[i].status == 201;
            CHECK_THAT(client[i].job == client[0].job, "job %lld and job %lld", client[i].job, client[0].job);
        }
        CHECK_THAT(made == 1, "%d replies say that they made the job", made);
        pthread_barrier_destroy(&start);
    }
    rig_must(store_count(rig.store, &counts, &err), &err, "store_count");
    figure("jobs made by parallel creates, for each key", (double)counts.jobs_by_state[JOB_QUEUED] / rounds, 1,
           "lower");
    CHECK_THAT(counts.jobs_by_state[JOB_QUEUED] == rounds, "%lld jobs of %d keys",
               (long long)counts.jobs_by_state[JOB_QUEUED], rounds);
    rig_stop(&rig);
    return check_result();
}

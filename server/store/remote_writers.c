/* remote_writers.c -- how many requests write outputs of an attempt elsewhere at this moment; under the store's
 * mutex. */
#include "common/mem.h"
#include "server/store/internal.h"

static struct remote_writer *find_writer(const struct store *store, int64_t job_id, int number) {
    for (size_t i = 0; i < store->remote.writer_count; i++)
        if (store->remote.writer[i].job_id == job_id && store->remote.writer[i].number == number)
            return &store->remote.writer[i];
    return NULL;
}

size_t remote_writer_count(const struct store *store, int64_t job_id, int number) {
    const struct remote_writer *writer = find_writer(store, job_id, number);
    return writer ? writer->count : 0;
}

void remote_writer_add(struct store *store, int64_t job_id, int number) {
    struct remote_writer *writer = find_writer(store, job_id, number);
    if (!writer) {
        struct remote_table *t = &store->remote;
        t->writer = mem_realloc_array(t->writer, t->writer_count + 1, sizeof *t->writer);
        writer = &t->writer[t->writer_count++];
        *writer = (struct remote_writer){.job_id = job_id, .number = number};
    }
    writer->count++;
}

void remote_writer_drop(struct store *store, int64_t job_id, int number) {
    struct remote_writer *writer = find_writer(store, job_id, number);
    if (writer && --writer->count == 0)
        *writer = store->remote.writer[--store->remote.writer_count];
}

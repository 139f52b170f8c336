/* test_sandbox.c -- what a confined process can no longer do, and what it still can. */
#include "server/worker/sandbox.h"

#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <pthread.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "tests/check.h"

static int open_new(const char *dir, const char *name) {
    char *path = file_join(dir, name);
    int fd = open(path, O_WRONLY | O_CREAT, 0600);
    mem_free(path);
    return fd;
}

static void *other_thread(void *argument) {
    (void)argument;
    CHECK(socket(AF_INET, SOCK_STREAM, 0) < 0);
    return NULL;
}

/* Pictures whose decoders are libraries of their own, which may be opened only now, and may start threads. */
static const char *const pictures[] = {"turned.heic", "blocks.avif", "alpha.avif"};
#define PICTURE_COUNT (sizeof pictures / sizeof *pictures)

static void read_pictures(const char *readable) {
    for (size_t i = 0; i < PICTURE_COUNT; i++) {
        struct image image;
        struct error err;
        char *path = file_join(readable, pictures[i]);
        CHECK_THAT(image_read(path, &image, NULL, &err) == STATUS_OK, "%s", err.message);
        image_release(&image);
        mem_free(path);
    }
}

static void copy_pictures(const char *readable) {
    for (size_t i = 0; i < PICTURE_COUNT; i++) {
        struct buf bytes;
        struct error err;
        char *from = file_join("tests/data/image", pictures[i]), *to = file_join(readable, pictures[i]);
        buf_init(&bytes, 1 << 20);
        CHECK(file_read(from, &bytes, &err) == STATUS_OK);
        CHECK(file_replace(to, bytes.data, bytes.length, &err) == STATUS_OK);
        buf_release(&bytes);
        mem_free(from);
        mem_free(to);
    }
}

/* In a child: there is no way back. */
static int confined(const char *writable, const char *readable, const char *other) {
    struct sandbox_result result;
    struct sandbox sandbox = {.write_dir = writable, .read_dir = {readable}, .memory_bytes = (uint64_t)256 << 20};
    char *secret = file_join(other, "secret"), *photo = file_join(readable, "photo");
    sandbox_enter(&sandbox, &result);
    printf("%s\n", result.text);
    CHECK(result.text[0]);

    if (result.system_calls) {
        CHECK(socket(AF_INET, SOCK_STREAM, 0) < 0 && errno == ENOSYS);
        CHECK(socket(AF_INET6, SOCK_DGRAM, 0) < 0 && errno == ENOSYS);
        char *const argv[] = {"true", NULL};
        CHECK(execv("/bin/true", argv) < 0 && errno == ENOSYS);
        CHECK(kill(getppid(), 0) < 0 && errno == ENOSYS);
        CHECK(kill(getpid(), 0) == 0);
        pthread_t thread;
        CHECK(pthread_create(&thread, NULL, other_thread, NULL) == 0);
        pthread_join(thread, NULL);
    }
    if (result.files) {
        CHECK(open_new(readable, "new") < 0 && errno == EACCES);
        CHECK(open_new(other, "new") < 0 && errno == EACCES);
        CHECK(open(secret, O_RDONLY) < 0 && errno == EACCES);
        CHECK(open(other, O_RDONLY | O_DIRECTORY) < 0);
        CHECK(open("/etc/passwd", O_RDONLY) < 0);
        CHECK(symlink("/etc/passwd", "link") < 0);
    }
    if (result.memory) {
        void *much = malloc((size_t)1 << 30);
        CHECK(much == NULL);
        free(much);
    }
    /* What the work needs. */
    struct error err;
    int fd = open_new(writable, "a");
    CHECK(fd >= 0 && write(fd, "x", 1) == 1 && ftruncate(fd, 0) == 0);
    close(fd);
    CHECK(open(photo, O_RDONLY) >= 0);
    read_pictures(readable);
    char *path = file_join(writable, "out/b");
    char *dir = file_join(writable, "out");
    CHECK_THAT(file_make_dirs(dir, &err) == STATUS_OK, "%s", err.message);
    CHECK_THAT(file_replace(path, "y", 1, &err) == STATUS_OK, "%s", err.message);
    CHECK_THAT(file_remove_tree(dir, &err) == STATUS_OK, "%s", err.message);
    void *some = malloc((size_t)16 << 20);
    CHECK(some != NULL);
    free(some);
    mem_free(path);
    mem_free(dir);
    mem_free(secret);
    mem_free(photo);
    return check_result();
}

int main(void) {
    char root[] = "/tmp/unbake-test-sandbox-XXXXXX";
    if (!mkdtemp(root))
        return 1;
    static const char *const names[] = {"write", "read", "other"};
    char *dir[3];
    struct error err;
    for (int i = 0; i < 3; i++) {
        dir[i] = file_join(root, names[i]);
        CHECK(mkdir(dir[i], 0700) == 0);
    }
    close(open_new(dir[1], "photo"));
    close(open_new(dir[2], "secret"));
    copy_pictures(dir[1]);
    fflush(stdout);
    pid_t child = fork();
    if (child == 0)
        exit(confined(dir[0], dir[1], dir[2]));
    int status;
    CHECK(waitpid(child, &status, 0) == child);
    CHECK_THAT(status == 0, "wait status %x", (unsigned)status);
    CHECK(file_remove_tree(root, &err) == STATUS_OK);
    for (int i = 0; i < 3; i++)
        mem_free(dir[i]);
    return check_result();
}

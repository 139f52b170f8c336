/* scheduler_plays.h -- what a worker does in the place of a real one, by the role that its job or scene is given. */
#ifndef UNBAKE_TESTS_UNIT_SCHEDULER_PLAYS_H
#define UNBAKE_TESTS_UNIT_SCHEDULER_PLAYS_H

#include <sys/stat.h>

#include "tests/unit/scheduler_rig.h"

static inline void announce(struct progress *p, const char *dir, const char *name, const char *claimed,
                            uint64_t bytes) {
    char *path = mem_printf("%s/out/%s", dir, name);
    if (file_replace(path, "data", 4, &err) != STATUS_OK)
        _exit(99);
    mem_free(path);
    progress_file(p, "output", claimed, bytes, SCENE_A, "text/plain");
}

/* 0 when this process has only what a worker should have. */
static inline int check_surroundings(const char *dir) {
    int bad = 0;
    for (int fd = 4; fd < 1024; fd++)
        bad += fcntl(fd, F_GETFD) >= 0;
    bad += fcntl(PROGRESS_FD, F_GETFD) < 0;
    bad += getsid(0) != getpid();
    char text[16] = "";
    int fd = open("/proc/self/oom_score_adj", O_RDONLY);
    bad += read(fd, text, sizeof text - 1) <= 0 || atoi(text) != 500;
    close(fd);
    sigset_t blocked;
    sigprocmask(SIG_SETMASK, NULL, &blocked);
    bad += sigismember(&blocked, SIGTERM) != 0;
    char *log = file_join(dir, "../worker.log");
    bad += access(log, F_OK) != 0;
    mem_free(log);
    return bad;
}

/* Says what no honest worker would: no JSON, too much of it, files that are not there, not its own or
 * of another size. An exit status where it cannot even lie. */
static inline int lie(struct progress *p, const char *dir) {
    static const char garbage[] =
        "\n{\"type\":\n[1,2]\n\"x\"\nnull\n{}\n{\"type\":7}\n\xff\xfe\n"
        "{\"type\":\"progress\",\"stage\":3}\n"
        "{\"type\":\"end\",\"status\":7}\n{\"type\":\"end\",\"status\":\"input\",\"message\":7}\n"
        "{\"type\":\"end\",\"status\":\"input\",\"hint\":7}\n"
        "{\"type\":\"checkpoint\",\"iteration\":\"x\"}\n{\"type\":\"checkpoint\",\"bytes\":\"x\"}\n"
        "{\"type\":\"checkpoint\",\"seconds\":\"x\"}\n{\"type\":\"metric\",\"series\":7}\n"
        "{\"type\":\"metric\",\"step\":\"x\"}\n{\"type\":\"metric\",\"value\":\"x\"}\n"
        "{\"type\":\"output\",\"name\":7}\n{\"type\":\"output\",\"sha256\":7}\n"
        "{\"type\":\"output\",\"content_type\":7}\n{\"type\":\"output\",\"bytes\":\"x\"}\n";
    if (write(PROGRESS_FD, garbage, sizeof garbage - 1) < 0)
        return 98;
    char *huge = mem_alloc(300000);
    memset(huge, 'x', 300000);
    huge[299999] = '\n';
    for (size_t at = 0; at < 300000;) {
        ssize_t wrote = write(PROGRESS_FD, huge + at, 300000 - at);
        if (wrote < 0)
            return 97;
        at += (size_t)wrote;
    }
    mem_free(huge);
    char *order = file_join(dir, "job.json");
    struct stat info;
    if (stat(order, &info) != 0)
        return 93;
    mem_free(order);
    announce(p, dir, "a.txt", "../job.json", (uint64_t)info.st_size);
    announce(p, dir, "a.txt", "missing.txt", 4);
    announce(p, dir, "a.txt", "a.txt", 5);
    char *link = mem_printf("%s/out/link.txt", dir);
    if (symlink("a.txt", link) == 0)
        progress_file(p, "output", "link.txt", 5, SCENE_A, "text/plain");
    mem_free(link);
    return 0;
}

/* More than is heard, and then what must be. */
static inline int talk(struct progress *p, const char *dir) {
    progress_stage(p, "refine");
    for (int i = 0; i < 3 * RIG_EVENTS_MAX; i++) {
        progress_metric(p, "loss", i, 0.5);
        progress_log(p, "info", "so far so good");
        progress_step(p, "refine", i, 1000, 1);
    }
    announce(p, dir, "a.txt", "a.txt", 5); /* not so large */
    announce(p, dir, "b.txt", "b.txt", 4);
    announce(p, dir, "a.txt", "a.txt", 4);
    progress_step(p, "export", 7, 7, 0);
    progress_end(p, STATUS_OK, "", "");
    return 0;
}

/* An attempt that goes well. */
static inline int play_whole(struct progress *p, const char *dir) {
    progress_stage(p, "prepare");
    progress_step(p, "refine", 3, 4, 1.5);
    progress_metric(p, "loss", 3, 0.25);
    /* As progress_log, and what is for the daemon to say. */
    static const char hello[] = "{\"type\":\"log\",\"level\":\"info\",\"message\":\"hello\",\"job\":1,\"attempt\":9,"
                                "\"at\":\"1970-01-01T00:00:00.000Z\",\"snapshot\":true}\n";
    if (write(PROGRESS_FD, hello, sizeof hello - 1) != sizeof hello - 1)
        return 92;
    progress_checkpoint(p, 3, 1000000, 0.1);
    announce(p, dir, "good.txt", "good.txt", 4);
    progress_end(p, STATUS_OK, "", "");
    return 0;
}

/* Roles that only say how they end. */
static const struct {
    const char *role;
    bool says; /* an end, by these: */
    enum status status;
    const char *message, *hint;
    int code; /* exit status */
} ends[] = {
    {"input", true, STATUS_INPUT, "the mesh is empty", "export it again", PROGRESS_EXIT_INPUT},
    {"full", true, STATUS_NO_SPACE, "checkpoint.db: no space", "", PROGRESS_EXIT_NO_SPACE},
    {"silent", false, STATUS_OK, "", "", 0},
    {"two-faced", true, STATUS_IO, "the disk is broken", "", 0},
    {"broken", true, STATUS_IO, "the disk is broken", "", PROGRESS_EXIT_FAILED},
    {"late", true, STATUS_OK, "", "", PROGRESS_EXIT_FAILED},
    {"deserter", false, STATUS_OK, "", "", PROGRESS_EXIT_STOPPED},
};

static inline int play(const char *role, const char *dir, int attempt) {
    struct progress p = {.fd = PROGRESS_FD};
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        if (strcmp(role, ends[i].role) != 0)
            continue;
        if (ends[i].says)
            progress_end(&p, ends[i].status, ends[i].message, ends[i].hint);
        return ends[i].code;
    }
    if (strcmp(role, "talker") == 0)
        return talk(&p, dir);
    signal(SIGTERM, on_term);
    if (strcmp(role, "once") == 0)
        role = attempt == 1 ? "segv" : "good";
    if (strcmp(role, "segv") == 0) {
        fprintf(stderr, "fatal: boom\n");
        signal(SIGSEGV, SIG_DFL); /* also under a sanitizer */
        raise(SIGSEGV);
    }
    if (strcmp(role, "hang") == 0) {
        progress_stage(&p, "refine");
        while (!told_to_stop)
            usleep(2000);
        return PROGRESS_EXIT_STOPPED;
    }
    if (strcmp(role, "stubborn") == 0) {
        progress_stage(&p, "refine");
        for (;;)
            usleep(10000);
    }
    if (strcmp(role, "memory") == 0) {
        fprintf(stderr, "out of memory: could not allocate 12345 bytes\n");
        return PROGRESS_EXIT_MEMORY;
    }
    if (strcmp(role, "killed") == 0) {
        litter(dir);
        progress_file(&p, "output", "tmp-a1B2c3", 0, SCENE_A, "text/plain");
        kill(getpid(), SIGKILL);
    }
    if (strcmp(role, "surroundings") == 0) {
        int bad = check_surroundings(dir);
        progress_end(&p, bad ? STATUS_INPUT : STATUS_OK, "surroundings", "");
        return bad ? PROGRESS_EXIT_INPUT : 0;
    }
    if (strcmp(role, "liar") == 0) {
        int bad = lie(&p, dir);
        if (bad)
            return bad;
    }
    return play_whole(&p, dir);
}

/* "large" fits the disk once there is a file "room" in the data folder. */
static inline int play_check(const char *role, const char *dir) {
    struct progress p = {.fd = PROGRESS_FD};
    char *files = file_join(dir, "files"), *room = file_join(dir, "../../room");
    if (file_make_dirs(files, &err) != STATUS_OK)
        return 92;
    if (strcmp(role, "crash") == 0)
        abort();
    if (strcmp(role, "large") == 0 && access(room, F_OK) != 0) {
        progress_end(&p, STATUS_NO_SPACE, "cannot write mesh.ply", "");
        return PROGRESS_EXIT_NO_SPACE;
    }
    mem_free(files);
    mem_free(room);
    if (strcmp(role, "ruin") == 0) {
        for (int i = 0; i < 1005; i++)
            progress_problem(&p, "images/1.png", "is truncated", NULL);
        progress_end(&p, STATUS_INPUT, "1005 problems", "");
        return PROGRESS_EXIT_INPUT;
    }
    if (strcmp(role, "bad") == 0) {
        progress_problem(&p, "mesh.ply", "face 3 has no area", NULL);
        progress_problem(&p, "images/1.png", "is truncated", "copy it again");
        progress_end(&p, STATUS_INPUT, "2 problems", "");
        return PROGRESS_EXIT_INPUT;
    }
    check_out(&p);
    return 0;
}

#endif

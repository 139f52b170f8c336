/* test_interleavings.c -- all that users and the scheduler can do to jobs, in random order, the process
 * that has the store killed now and then: after every step each job is what a model of the states
 * (the diagram in job.h, written down once more, as a table) says. What was under way at a kill has
 * happened or has not. At the end the events of every job tell a way along the arrows.
 * UNBAKE_STEPS sets how many steps (1,000; in the long form 100,000), UNBAKE_SEED which. */
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>

#include "tests/api/rig.h"
#include "tests/figures.h"

#define JOBS 24
#define ATTEMPTS 2 /* as the rig has it */

/* --- the process that has the store ------------------------------------------------------------- */

/* "start|succeed|fail|crash|stop|block JOB ATTEMPT", as a scheduler would. */
static enum status obey(struct rig *rig, const char *line, struct error *err) {
    char word[16];
    long long job;
    int attempt;
    if (sscanf(line, "%15s %lld %d", word, &job, &attempt) != 3)
        return error_set(err, STATUS_INPUT, "what is \"%s\"?", line);
    if (strcmp(word, "start") == 0)
        return store_job_start(rig->store, job, "process", &attempt, err);
    if (strcmp(word, "succeed") == 0)
        return store_job_succeed(rig->store, job, attempt, "", err);
    if (strcmp(word, "fail") == 0)
        return store_job_fail(rig->store, job, attempt, "r", "h", err);
    if (strcmp(word, "crash") == 0)
        return store_job_crash(rig->store, job, attempt, "r", "h", 0, err);
    if (strcmp(word, "stop") == 0)
        return store_job_stop(rig->store, job, attempt, "", err);
    return store_job_block(rig->store, job, attempt, "r", "h", err);
}

static void serve(const char *folder, FILE *in, FILE *out) {
    struct rig rig;
    struct error err;
    size_t requeued;
    char line[128];
    memset(&rig, 0, sizeof rig);
    snprintf(rig.dir, sizeof rig.dir, "%s", folder);
    rig_open(&rig, &rig_patient, 60, 100, 10);
    rig.api->config.queue_limit = 1000000;
    rig_must(store_reconcile(rig.store, NULL, 0, &requeued, &err), &err, "store_reconcile");
    rig_scene(&rig);
    fprintf(out, "%u\n", listener_port(rig.listener));
    fflush(out);
    while (fgets(line, sizeof line, in)) {
        enum status status = obey(&rig, line, &err);
        fprintf(out, "%s\n", status == STATUS_OK ? "ok" : status == STATUS_CONFLICT ? "conflict" : err.message);
        fflush(out);
    }
    listener_quiesce(rig.listener);
    listener_stop(rig.listener);
    service_free(rig.api);
    scheduler_free(rig.scheduler);
    store_close(rig.store);
    exit(0);
}

static char dir[] = "/tmp/unbake-chaos-XXXXXX";
static pid_t pid;
static FILE *to, *from;
static int port;

static void start(void) {
    int down[2], up[2];
    char line[64];
    if (pipe(down) != 0 || pipe(up) != 0)
        exit(1);
    pid = fork();
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        close(down[1]);
        close(up[0]);
        serve(dir, fdopen(down[0], "r"), fdopen(up[1], "w"));
    }
    close(down[0]);
    close(up[1]);
    to = fdopen(down[1], "w");
    from = fdopen(up[0], "r");
    if (!fgets(line, sizeof line, from) || (port = atoi(line)) == 0) {
        fprintf(stderr, "the process does not start\n");
        exit(1);
    }
}

static void stop(int number) {
    if (number)
        kill(pid, number);
    fclose(to);
    fclose(from);
    waitpid(pid, NULL, 0);
}

/* --- the model ---------------------------------------------------------------------------------- */

enum condition { QUEUED, RUNNING, TO_PAUSE, TO_CANCEL, PAUSED, SUCCEEDED, FAILED, CANCELLED, CONDITIONS };
static const char letters[] = "QRUNPSFC";

enum action {
    CANCEL,
    PAUSE,
    RESUME,
    RETRY,
    AGAIN,
    EXTEND,
    EDIT,
    USERS, /* over HTTP */
    START = USERS,
    SUCCEED,
    FAIL,
    CRASH,
    STOP,
    BLOCK,
    ACTIONS
};
static const char *const words[ACTIONS] = {
    [CANCEL] = "cancel", [PAUSE] = "pause", [RESUME] = "resume", [RETRY] = "retry",     [AGAIN] = "retry?from=report",
    [EXTEND] = "extend", [EDIT] = "",       [START] = "start",   [SUCCEED] = "succeed", [FAIL] = "fail",
    [CRASH] = "crash",   [STOP] = "stop",   [BLOCK] = "block"};
/* What comes of it: the next condition, '=' nothing new, '-' refused. */
static const char *const table[ACTIONS] = {
    /*           QRUNPSFC */
    [CANCEL] = "CNN=C--=", [PAUSE] = "PU=-=---", [RESUME] = "==R-Q---", [RETRY] = "------QQ",   [AGAIN] = "-----QQQ",
    [EXTEND] = "-----QQQ", [EDIT] = "========",  [START] = "R-------",  [SUCCEED] = "-SSC----", [FAIL] = "-FFC----",
    [CRASH] = "-QPC----",  [STOP] = "-QPC----",  [BLOCK] = "-PPC----"};

struct model {
    long long id; /* 0: none */
    enum condition condition;
    int attempt, attempts_left;
};

static struct model job[JOBS];
static unsigned random_ = 1;
static long illegal, kills, deaths_in_action;

static unsigned draw(unsigned limit) {
    random_ = random_ * 1664525u + 1013904223u;
    return (random_ >> 8) % limit;
}

/* The model after the action; *refused when it is not allowed. */
static struct model after(struct model m, enum action action, bool stale, bool *refused) {
    char next = table[action][m.condition];
    *refused = next == '-' || (stale && action > START);
    if (*refused || next == '=')
        return m;
    m.condition = (enum condition)(strchr(letters, next) - letters);
    if (action == START)
        m.attempt++;
    if (action == RETRY || action == AGAIN || action == EXTEND)
        m.attempts_left = ATTEMPTS;
    if (action == CRASH && m.attempts_left > 0 && --m.attempts_left == 0 && next != 'C')
        m.condition = FAILED;
    return m;
}

/* What a restart makes of it. */
static struct model restarted(struct model m) {
    static const char become[] = "QQPCPSFC";
    m.condition = (enum condition)(strchr(letters, become[m.condition]) - letters);
    return m;
}

/* --- steps -------------------------------------------------------------------------------------- */

/* The status of a request; 0 where no whole reply came. */
static int ask(const char *method, const char *path, const char *fields, const char *data, struct buf *body) {
    char chunk[16384];
    ssize_t got;
    int status = 0;
    struct sockaddr_in at = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    buf_init(body, 1 << 24);
    if (connect(fd, (struct sockaddr *)&at, sizeof at) == 0) {
        char *text =
            mem_printf("%s %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n%sContent-Length: %zu\r\n\r\n%s",
                       method, path, fields, strlen(data), data);
        rig_send(fd, text, strlen(text));
        mem_free(text);
        while ((got = recv(fd, chunk, sizeof chunk, 0)) > 0)
            buf_append(body, chunk, (size_t)got);
    }
    close(fd);
    sscanf(buf_text(body), "HTTP/1.1 %d", &status);
    return status;
}

static enum status act(const struct model *m, enum action action, int attempt, bool *answered) {
    char path[80], line[128] = "";
    struct buf reply;
    int status;
    *answered = true;
    if (action >= USERS) {
        fprintf(to, "%s %lld %d\n", words[action], m->id, attempt);
        fflush(to);
        *answered = fgets(line, sizeof line, from) != NULL;
        if (*answered && strcmp(line, "ok\n") != 0 && strcmp(line, "conflict\n") != 0)
            CHECK_THAT(false, "%s of job %lld: %s", words[action], m->id, line);
        return strcmp(line, "ok\n") == 0 ? STATUS_OK : STATUS_CONFLICT;
    }
    if (action == EDIT) {
        snprintf(path, sizeof path, "/v1/jobs/%lld", m->id);
        status = ask("PATCH", path, "If-Match: *\r\nContent-Type: application/json\r\n",
                     draw(2) ? "{\"order\":\"first\"}" : "{\"priority\":3,\"name\":\"x\"}", &reply);
    } else {
        snprintf(path, sizeof path, "/v1/jobs/%lld/%s", m->id, words[action]);
        status = ask("POST", path, action == EXTEND ? "Content-Type: application/json\r\n" : "",
                     action == EXTEND ? "{\"looks\":1}" : "", &reply);
    }
    *answered = status != 0;
    CHECK_THAT(status == 0 || status == 200 || status == 202 || status == 409, "%s of job %lld gets %d: %s", path,
               m->id, status, rig_body(&reply));
    buf_release(&reply);
    return status == 409 ? STATUS_CONFLICT : STATUS_OK;
}

/* Whether the job is what the model says. */
static bool is_so(const struct model *m) {
    static const char *const states[] = {"queued", "running",   "running", "running",
                                         "paused", "succeeded", "failed",  "cancelled"};
    static const char *const wanted[] = {"run", "run", "pause", "cancel", "run", "run", "run", "run"};
    char path[48], parts[4][48];
    struct buf reply;
    snprintf(path, sizeof path, "/v1/jobs/%lld", m->id);
    snprintf(parts[0], sizeof parts[0], "\"state\":\"%s\"", states[m->condition]);
    snprintf(parts[1], sizeof parts[1], "\"wanted\":\"%s\"", wanted[m->condition]);
    snprintf(parts[2], sizeof parts[2], "\"attempt\":%d,", m->attempt);
    snprintf(parts[3], sizeof parts[3], "\"attempts_left\":%d,", m->attempts_left);
    bool so = ask("GET", path, "", "", &reply) == 200;
    for (int i = 0; i < 4; i++)
        so = so && strstr(rig_body(&reply), parts[i]);
    buf_release(&reply);
    return so;
}

/* The events of a job, one after another: each state may follow the one before. */
static void check_history(const struct model *m) {
    char path[64];
    struct buf reply;
    enum job_state last = JOB_QUEUED;
    bool begun = false;
    snprintf(path, sizeof path, "/v1/jobs/%lld/events?after=0&follow=0", m->id);
    int status = ask("GET", path, "", "", &reply);
    CHECK_THAT(status == 200, "%s gives %d", path, status);
    for (const char *at = buf_text(&reply); (at = strstr(at, "data: {\"state\":\"")) != NULL; at++) {
        char name[16] = "";
        enum job_state state = JOB_QUEUED;
        sscanf(at, "data: {\"state\":\"%15[a-z]", name);
        /* A wish is told in the state that it finds, and so is one that is taken back. */
        bool legal =
            job_state_parse(name, &state) &&
            (!begun ? state == JOB_QUEUED : job_may_become(last, state) || (state == last && state == JOB_RUNNING));
        if (!legal) {
            fprintf(stderr, "job %lld goes from %s to %s\n", m->id, job_state_name(last), name);
            illegal++;
        }
        begun = true;
        last = state;
    }
    buf_release(&reply);
}

static void submit(struct model *m) {
    struct buf reply;
    int status = ask("POST", "/v1/jobs", "Content-Type: application/json\r\n", "{\"scene\":\"" RIG_SCENE "\"}", &reply);
    CHECK_THAT(status == 201, "a submission gets %d", status);
    *m = (struct model){.condition = QUEUED, .attempts_left = ATTEMPTS};
    sscanf(rig_body(&reply), "{\"id\":%lld", &m->id);
    buf_release(&reply);
    char *folder = mem_printf("%s/jobs/%lld/attempt-1/checkpoint", dir, m->id),
         *file = file_join(folder, "checkpoint.db");
    struct error err;
    rig_must(file_make_dirs(folder, &err), &err, "a folder");
    rig_must(file_replace(file, "x", 1, &err), &err, "a file"); /* so that it can be extended */
    mem_free(file);
    mem_free(folder);
}

/* DELETE, which what runs refuses. */
static void drop(struct model *m) {
    char path[48];
    struct buf reply;
    check_history(m);
    snprintf(path, sizeof path, "/v1/jobs/%lld", m->id);
    int status = ask("DELETE", path, "", "", &reply);
    bool runs = m->condition == RUNNING || m->condition == TO_PAUSE || m->condition == TO_CANCEL;
    CHECK_THAT(status == (runs ? 409 : 204), "deleting a job that is %c gets %d", letters[m->condition], status);
    buf_release(&reply);
    if (!runs)
        m->id = 0;
}

/* The process dies: while it does something for job m, or in peace. */
static void die(struct model *m) {
    pid_t killer = -1;
    bool answered = true, refused = false;
    struct model next = *m;
    if (m->id && draw(4)) {
        enum action action = (enum action)draw(ACTIONS);
        next = after(*m, action, false, &refused);
        unsigned delay = draw(2000);
        fflush(NULL);
        killer = fork();
        if (killer == 0) {
            usleep(delay);
            kill(pid, SIGKILL);
            _exit(0);
        }
        act(m, action, m->attempt, &answered);
        deaths_in_action += !answered;
        waitpid(killer, NULL, 0);
    }
    stop(SIGKILL);
    kills++;
    start();
    for (int i = 0; i < JOBS; i++) {
        struct model before = job[i];
        if (&job[i] == m)
            job[i] = next;
        job[i] = restarted(job[i]);
        if (!job[i].id || is_so(&job[i]))
            continue;
        /* Not answered: it may not have happened. */
        job[i] = restarted(before);
        CHECK_THAT(&job[i] == m && !answered && is_so(&job[i]), "job %lld is not %c after a restart", job[i].id,
                   letters[job[i].condition]);
    }
}

static void step(void) {
    struct model *m = &job[draw(JOBS)];
    bool refused, answered;
    if (draw(60) == 0) {
        die(m);
    } else if (!m->id) {
        submit(m);
    } else if (draw(25) == 0) {
        drop(m);
    } else {
        enum action action = (enum action)draw(ACTIONS);
        bool stale = draw(8) == 0 && m->attempt > 1;
        struct model next = after(*m, action, stale, &refused);
        enum status status = act(m, action, m->attempt - stale, &answered);
        CHECK_THAT((status == STATUS_CONFLICT) == refused, "%s of a job that is %c", words[action],
                   letters[m->condition]);
        *m = next;
    }
    if (m->id && !is_so(m)) {
        CHECK_THAT(false, "job %lld is not %c, attempt %d, %d left", m->id, letters[m->condition], m->attempt,
                   m->attempts_left);
        illegal++;
    }
}

int main(void) {
    long steps = figures_count("UNBAKE_STEPS", 1000, 100000), done = 0;
    random_ = (unsigned)figures_count("UNBAKE_SEED", 1, 1);
    if (!mkdtemp(dir))
        return 1;
    start();
    for (; done < steps && check_failed_count == 0; done++)
        step();
    for (int i = 0; i < JOBS; i++)
        if (job[i].id)
            check_history(&job[i]);
    stop(0);
    printf("%ld steps, %ld kills, %ld of them in the middle of an action\n", done, kills, deaths_in_action);
    figure("random interleavings: steps", (double)done, 1e5, "higher");
    figure("random interleavings: illegal transitions", (double)(illegal + check_failed_count), 0, "lower");
    CHECK(illegal == 0);
    if (check_failed_count == 0)
        file_remove_tree(dir, NULL);
    return check_result();
}

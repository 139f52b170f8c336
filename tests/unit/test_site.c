/* test_site.c -- files of executors.d: what is refused and why, lines of commands' output, commands and their deadline;
 * and that the files which come with the program are as they must be. */
#include <dirent.h>
#include <pwd.h>
#include <string.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "server/executor/command.h"
#include "server/executor/job_status.h"
#include "tests/check.h"

static struct error err;
static char dir[] = "/tmp/unbake-test-site-XXXXXX";

#define GOOD                                                                                                                      \
    "submit = sub --name={name} \"two words\"\nsubmit_id = job {id}\nstatus = stat\nstatus_line = {id}|{name}|{state}|{reason}\n" \
    "cancel = del {id}\nwaiting = PD Q\nrunning = R\nurl = http://h:1\n"
#define SCRIPT "[script]\n#!/bin/sh\nX={token} ${HOME} {{end}} exec {command}\n"

/* Reads a file of that text; its problems, in static storage. */
static const char *problems_of(const char *text, struct site *site) {
    static char told[4096];
    struct buf problems;
    char *path = file_join(dir, "x.conf");
    buf_init(&problems, sizeof told - 1);
    CHECK(file_replace(path, text, strlen(text), &err) == STATUS_OK);
    CHECK(site_read(site, "x", path, &problems, &err) == STATUS_OK);
    snprintf(told, sizeof told, "%s", buf_text(&problems));
    buf_release(&problems);
    mem_free(path);
    return told;
}

static void expect(const char *text, const char *problem) {
    struct site site;
    const char *told = problems_of(text, &site);
    CHECK_THAT(*problem ? strstr(told, problem) != NULL : !*told, "\"%s\", wanted \"%s\"", told, problem);
    site_release(&site);
}

static void test_faults(void) {
    expect(GOOD SCRIPT, "");
    expect(GOOD "sumbit = x\n" SCRIPT, "x.conf:9: unknown key \"sumbit\"; did you mean submit?");
    expect(GOOD "url = http://i\n" SCRIPT, "url is given twice");
    expect(GOOD "threads = many\n" SCRIPT, "threads must be a whole number from 1 to 1024, not \"many\"");
    expect(GOOD "nonsense\n" SCRIPT, "is not of the form key = value");
    expect(GOOD "info = look {job}\n" SCRIPT, "info has an unknown placeholder {job}");
    expect(GOOD "info = \"look\n" SCRIPT, "info has a quotation mark without its partner");
    expect(GOOD SCRIPT "{partitoin}\n", "the script has an unknown placeholder {partitoin}");
    expect(GOOD, "the script must have the placeholders {token} and {command}");
    expect("status = s\n" SCRIPT, "submit is missing");
    expect("submit = s {token}\n" SCRIPT, "submit has an unknown placeholder {token}"); /* a command line is public */
    expect(GOOD "partition = a;b\n" SCRIPT, "partition may only have letters");
    expect("submit_id = nothing\nstatus_line = {name}{state}\nurl = ftp://x\n" SCRIPT,
           "submit_id must have the placeholder {id}");
    expect("status_line = {name}{state}\n" SCRIPT, "two placeholders with nothing between them");
    expect("url = ftp://x\n" SCRIPT, "url must begin with http://, https:// or unix:/");
    expect(GOOD "ca = /a b\n" SCRIPT, "ca may only have letters");
    expect(GOOD "ca = /lab.pem\n" SCRIPT, "ca is for a url that begins with https://");
    expect("status = s {ids}\nmax_running = 1600\n" SCRIPT,
           "max_running must be 1562 at most where status has {ids}, not 1600");
    CHECK(site_name_is_good("slurm-2") && !site_name_is_good("process") && !site_name_is_good("a/b") &&
          !site_name_is_good("") && !site_name_is_good("-x"));
}

static void test_filled(void) {
    struct site site;
    const char *told = problems_of(GOOD "node = /usr/bin/unbaked\ncache = /c\n" SCRIPT, &site);
    const struct site_job job = {
        .name = "unbake-1-2-ab", .token = "secret", .job_id = 1, .attempt = 2, .memory_bytes = 1024.0 * 0x1p20};
    CHECK_THAT(!*told, "%s", told);
    char **words = site_words(&site, site.submit, &job), *script = site_script(&site, &job);
    CHECK_STRING(words[1], "--name=unbake-1-2-ab");
    CHECK_STRING(words[2], "two words");
    CHECK(!words[3]);
    CHECK_STRING(script, "#!/bin/sh\nX=secret ${HOME} {{end}} exec /usr/bin/unbaked node http://h:1 --job 1 --attempt 2"
                         " --cache /c\n");
    CHECK(site_memory_mib(&site, job.memory_bytes) == 1280 && site_memory_mib(&site, 0.0) == 8192);
    CHECK(site_state_of(&site, "Q") == SITE_WAITING && site_state_of(&site, "R") == SITE_RUNNING &&
          site_state_of(&site, "P") == SITE_UNKNOWN && site_state_of(&site, "") == SITE_UNKNOWN);
    words_free(words);
    mem_free(script);
    char *parts[] = {"{user} {time_min} {time_sec}", NULL},
         *wanted = mem_printf("%s 1440 86400", getpwuid(geteuid())->pw_name);
    words = site_words(&site, parts, &job);
    CHECK_STRING(words[0], wanted);
    words_free(words);
    mem_free(wanted);

    /* Of one name the liveliest; others' jobs are left out; what only looks strange is not garbage, all of it is. */
    struct job_status_list jobs;
    CHECK(job_status_parse(&jobs, &site,
                           "noise\n7|unbake-1-2-ab|F|gone\n 8|unbake-1-2-ab|PD|Priority, of others \n9|mine|R|\n"));
    CHECK(jobs.count == 2 && !job_status_find(&jobs, "mine") && !job_status_find(&jobs, "unbake-1-2-a"));
    const struct job_status *found = job_status_find(&jobs, "unbake-1-2-ab");
    CHECK(found && found->state == SITE_WAITING);
    CHECK_STRING(found ? found->id : "", "8");
    CHECK_STRING(found ? found->reason : "", "Priority, of others");
    job_status_release(&jobs);
    CHECK(!job_status_parse(&jobs, &site, "slurm_load_jobs error: Unable to contact\n") && jobs.count == 0);
    job_status_release(&jobs);
    CHECK(job_status_parse(&jobs, &site, "") && jobs.count == 0);
    job_status_release(&jobs);
    site_release(&site);
}

static enum status run(const char *script, const char *input, double deadline_sec, char *text, size_t size) {
    char *argv[] = {"sh", "-c", mem_strdup(script), NULL};
    struct buf output;
    buf_init(&output, COMMAND_OUTPUT_MAX);
    enum status status = command_run(argv, input, deadline_sec, NULL, &output, &err);
    snprintf(text, size, "%s", buf_text(&output));
    buf_release(&output);
    mem_free(argv[2]);
    return status;
}

static void test_commands(void) {
    char text[256], *none[] = {"/no/such/program", NULL};
    struct buf output;
    CHECK(run("cat; echo done", "in\n", 30.0, text, sizeof text) == STATUS_OK);
    CHECK_STRING(text, "in\ndone\n");
    CHECK(run("echo said; echo no such queue >&2; exit 3", NULL, 30.0, text, sizeof text) == STATUS_IO);
    CHECK_STRING(err.message, "sh ended with status 3: no such queue");
    double begun = clock_sec();
    CHECK(run("sleep 100 & sleep 100", NULL, 0.2, text, sizeof text) == STATUS_UNAVAILABLE);
    CHECK(strstr(err.message, "did not end within"));
    /* Who keeps the output open does not keep this side. */
    CHECK(run("sleep 100 & echo here", NULL, 30.0, text, sizeof text) == STATUS_OK);
    CHECK_STRING(text, "here\n");
    CHECK(clock_sec() - begun < 60.0);
    CHECK(run("kill -SEGV $$", NULL, 30.0, text, sizeof text) == STATUS_IO && strstr(err.message, "was killed"));
    buf_init(&output, 100);
    CHECK(command_run(none, NULL, 1.0, NULL, &output, &err) == STATUS_NOT_FOUND);
    buf_release(&output);
}

/* Whether the time limit of its key is passed on. */
static bool has_limit(const struct site *site) {
    bool found = strstr(site->script, "{time_min}") || strstr(site->script, "{time_sec}");
    for (size_t i = 0; site->submit[i]; i++)
        found |= strstr(site->submit[i], "{time_min}") || strstr(site->submit[i], "{time_sec}");
    return found;
}

static void test_shipped(void) {
    DIR *folder = opendir("config/executors.d");
    int count = 0;
    CHECK(folder);
    for (const struct dirent *entry; folder && (entry = readdir(folder)) != NULL;) {
        size_t length = strlen(entry->d_name);
        if (length < 6 || strcmp(entry->d_name + length - 5, ".conf") != 0)
            continue;
        struct site site;
        struct buf problems;
        char *path = file_join("config/executors.d", entry->d_name);
        buf_init(&problems, 1 << 16);
        CHECK(site_read(&site, "shipped", path, &problems, &err) == STATUS_OK);
        CHECK_THAT(problems.length == 0, "%s", buf_text(&problems));
        CHECK_THAT(has_limit(&site), "%s sets no time limit", path);
        site_release(&site);
        buf_release(&problems);
        mem_free(path);
        count++;
    }
    CHECK(count == 5);
    if (folder)
        closedir(folder);
}

int main(void) {
    CHECK(mkdtemp(dir));
    test_faults();
    test_filled();
    test_commands();
    test_shipped();
    CHECK(file_remove_tree(dir, &err) == STATUS_OK);
    return check_result();
}

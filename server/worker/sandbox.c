/* sandbox.c -- see sandbox.h. */
#include "server/worker/sandbox.h"

#include <stdio.h>
#include <sys/prctl.h>
#include <sys/resource.h>

#include "server/worker/confine.h"

static bool limit_memory(uint64_t bytes) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    (void)bytes; /* the sanitizers' shadow memory exceeds any limit */
    return false;
#else
    struct rlimit limit = {.rlim_cur = bytes, .rlim_max = bytes};
    return setrlimit(RLIMIT_DATA, &limit) == 0;
#endif
}

static void describe(const struct sandbox *sandbox, struct sandbox_result *result) {
    if (result->files && result->system_calls && result->memory)
        snprintf(result->text, sizeof result->text, "sandbox: %s, no new programs, %s",
                 sandbox->connect_port ? "TCP to one port" : "no network",
                 sandbox->write_dir ? "only the job's folder is writable" : "nothing is writable");
    else
        snprintf(result->text, sizeof result->text, "sandbox: this system cannot%s%s%s",
                 result->files ? "" : " confine files (Landlock);",
                 result->system_calls ? "" : " refuse network and programs (seccomp);",
                 result->memory ? "" : " limit memory;");
}

void sandbox_enter(const struct sandbox *sandbox, struct sandbox_result *result) {
    *result = (struct sandbox_result){0};
    struct rlimit none = {0, 0};
    setrlimit(RLIMIT_CORE, &none);
    result->memory = sandbox->memory_bytes == 0 || limit_memory(sandbox->memory_bytes);
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0) {
        result->files = confine_files(sandbox);
        result->system_calls = confine_calls(sandbox->connect_port != 0);
    }
    describe(sandbox, result);
}

bool sandbox_keep_connection(void) { return confine_to_connection(); }

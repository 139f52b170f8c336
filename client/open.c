/* open.c -- `open`: the page of a job, or the server's, in a browser. */
#include <stdlib.h>
#include <string.h>

#include "client/commands.h"
#include "client/format.h"
#include "client/outcome.h"
#include "common/mem.h"

const struct command_option open_options[] = {
    {"print", 'p', OPTION_FLAG, NULL, "only print the address"},
    FORMAT_OPTION,
    {0},
};

static bool is_set(const char *variable) {
    const char *value = getenv(variable);
    return value && *value;
}

/* Shows the address in $BROWSER, else in the desktop's browser. False where there is none. */
static bool show(const char *url) {
    bool has_desktop = is_set("DISPLAY") || is_set("WAYLAND_DISPLAY");
    const char *browser = is_set("BROWSER") ? getenv("BROWSER") : has_desktop ? "xdg-open" : NULL;
    if (!browser)
        return false;
    /* What a browser says does not mix with the result. */
    char *command = mem_printf("%s \"$1\" >&2", browser);
    int status = outcome_shell(command, url);
    mem_free(command);
    return status == 0;
}

int open_run(struct client *c, const struct options *o) {
    struct reply reply;
    struct error err;
    int64_t id = 0;
    const char *server = request_server(c->request);
    reply_init(&reply);
    enum status status = STATUS_OK;
    if (strncmp(server, "http://", 7) != 0 && strncmp(server, "https://", 8) != 0)
        status = error_set(&err, STATUS_INPUT, "%s has no page: a browser needs http:// or https://", server);
    if (status == STATUS_OK && o->word_count) {
        status = client_job_id(c, o->word[0], &id, &reply, &err);
        if (status == STATUS_OK)
            status = client_job_get(c, id, &reply, &err);
    }
    if (status != STATUS_OK) {
        int code = client_fail(c, &reply, &err);
        reply_release(&reply);
        return code;
    }
    reply_release(&reply);
    char *url = id ? mem_printf("%s/#job=%lld", server, (long long)id) : mem_printf("%s/", server);
    if (!c->json)
        client_say(c, "%s", url);
    bool was_shown = !options_flag(o, "print") && show(url);
    if (c->json) {
        cJSON *object = cJSON_CreateObject();
        json_add_string(object, "url", url);
        json_add_bool(object, "opened", was_shown);
        client_print_json(c, object);
        cJSON_Delete(object);
    } else if (!was_shown && !options_flag(o, "print")) {
        client_note(c, "there is no browser here that can be started: $BROWSER names one");
    }
    mem_free(url);
    return CLIENT_OK;
}

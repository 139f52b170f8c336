/* commands.c -- see commands.h. Results go to stdout, faults to stderr with exit status 1, wrong
 * command lines and configurations with 2. */
#include "server/admin/commands.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/admin/admin.h"

const struct command_option token_flags[] = {
    {"role", 0, OPTION_TEXT, "ROLE", "of a new token: viewer, user or admin (the first token: admin; then: user)"},
    {"expires", 0, OPTION_TEXT, "WHEN",
     "of a new token: after 30d or 12h, or on a day such as 2027-01-31, at its end in UTC (never)"},
    {"json", 0, OPTION_FLAG, NULL, "print JSON"},
    INVOCATION_FLAGS,
    COMMAND_HELP_FLAG,
    {0},
};
const struct command_option usage_flags[] = {
    {"json", 0, OPTION_FLAG, NULL, "print JSON"}, INVOCATION_FLAGS, COMMAND_HELP_FLAG, {0}};
const struct command_option check_config_flags[] = {INVOCATION_FLAGS, COMMAND_HELP_FLAG, {0}};

int command_failed(const struct error *err) {
    fprintf(stderr, "unbaked: %s\n", err->message);
    if (*err->hint)
        fprintf(stderr, "  hint: %s\n", err->hint);
    return err->status == STATUS_INPUT ? EXIT_USAGE : EXIT_FAILURE;
}

int command_begin(const char *file, struct invocation *in, int argc, char **argv, const struct command_option *flags,
                  size_t words_min, size_t words_max) {
    int code = invocation_read(in, argc, argv, flags, file);
    if (code < 0 && invocation_has(in, "help"))
        return COMMAND_HELP;
    if (code < 0 && (in->arguments.word_count < words_min || in->arguments.word_count > words_max))
        return COMMAND_MISUSED;
    log_set_level(LOG_WARNING);
    return code;
}

/* Asks the daemon, and prints its reply as JSON where that is asked for, else by print(in, reply). The end of a
 * command, whose `code` is not below 0 where it has failed already: frees `request` and *in, returns the exit
 * status. */
static int ask(int code, struct invocation *in, cJSON *request,
               void print(const struct invocation *in, const cJSON *reply)) {
    struct error err;
    cJSON *reply = NULL;
    int fd;
    if (code < 0 && admin_call(in->config.data_dir, request, &reply, &fd, &err) != STATUS_OK) {
        code = command_failed(&err);
    } else if (code < 0 && invocation_has(in, "json")) {
        char *text = json_text(reply);
        printf("%s\n", text);
        mem_free(text);
    } else if (code < 0) {
        print(in, reply);
    }
    cJSON_Delete(request);
    cJSON_Delete(reply);
    invocation_release(in);
    return code < 0 ? EXIT_SUCCESS : code;
}

/* --- token --------------------------------------------------------------------------------- */

#define TIME_SIZE 32 /* of "2026-01-31 12:00Z", with the NUL, rounded up */
#define DAY_MS INT64_C(86400000)
#define HOUR_MS INT64_C(3600000)
#define EXPIRES_MAX 36500 /* days or hours: a century of the former */

static double time_of(const cJSON *item, const char *name, char text[TIME_SIZE]) {
    double ms = 0;
    json_number(item, name, "a token", 0, &ms, NULL);
    time_t seconds = (time_t)(ms / 1000);
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(text, TIME_SIZE, "%Y-%m-%d %H:%MZ", &utc);
    return ms;
}

static void print_tokens(const cJSON *items) {
    const cJSON *item;
    printf("%6s  %-20s %-7s %-17s  %s\n", "token", "user", "role", "made", "expires");
    cJSON_ArrayForEach(item, items) {
        char made[TIME_SIZE], expires[TIME_SIZE];
        time_of(item, "created_ms", made);
        double ms = time_of(item, "expires_ms", expires);
        printf("%6d  %-20s %-7s %-17s  %s%s\n", cJSON_GetObjectItem(item, "id")->valueint,
               cJSON_GetStringValue(cJSON_GetObjectItem(item, "user")),
               cJSON_GetStringValue(cJSON_GetObjectItem(item, "role")), made, ms > 0.0 ? expires : "never",
               ms > 0.0 && ms <= (double)clock_unix_ms() ? ", is past" : "");
    }
}

/* 30d, 12h or 2027-01-31; false for anything else. */
static bool read_expiry(const char *text, int64_t *expires_ms) {
    size_t digits = strspn(text, "0123456789");
    struct tm day = {0};
    if (digits > 0 && digits <= 5 && (text[digits] == 'd' || text[digits] == 'h') && text[digits + 1] == '\0') {
        int64_t count = strtoll(text, NULL, 10);
        *expires_ms = clock_unix_ms() + count * (text[digits] == 'd' ? DAY_MS : HOUR_MS);
        return count > 0 && count <= EXPIRES_MAX;
    }
    const char *rest = strptime(text, "%Y-%m-%d", &day);
    *expires_ms = rest && *rest == '\0' ? (int64_t)timegm(&day) * 1000 + DAY_MS : 0;
    return *expires_ms > 0;
}

static void print_token_reply(const struct invocation *in, const cJSON *reply) {
    const char *action = in->arguments.word[0];
    if (strcmp(action, "list") == 0) {
        print_tokens(cJSON_GetObjectItem(reply, "items"));
    } else if (strcmp(action, "add") == 0) {
        bool is_alone = cJSON_IsFalse(cJSON_GetObjectItem(reply, "daemon_runs"));
        fprintf(stderr, "This is shown once; whoever has it is user %s, role %s, of the data folder %s%s:\n",
                in->arguments.word[1], cJSON_GetStringValue(cJSON_GetObjectItem(reply, "role")), in->config.data_dir,
                is_alone ? ", on which no daemon runs now" : "");
        printf("%s\n", cJSON_GetStringValue(cJSON_GetObjectItem(reply, "token")));
        if (cJSON_IsFalse(cJSON_GetObjectItem(reply, "has_admin")))
            fputs(
                "unbaked: no token is an admin's: only this command can make others and revoke them, and others' jobs "
                "are out of reach; `unbaked token add NAME --role admin` makes one\n",
                stderr);
    } else {
        printf("revoked: %d\n", cJSON_GetObjectItem(reply, "count")->valueint);
    }
}

int token_command(int argc, char **argv) {
    struct invocation in;
    cJSON *request = cJSON_CreateObject();
    int code = command_begin(CONFIG_FILE_DEFAULT, &in, argc, argv, token_flags, 1, 2);
    const char *action = code < 0 ? in.arguments.word[0] : "";
    bool is_add = strcmp(action, "add") == 0, is_revoke = strcmp(action, "revoke") == 0;
    if (code < 0 && !is_add && !is_revoke && strcmp(action, "list") != 0) {
        fprintf(stderr, "unbaked: unknown command \"token %.80s\"; known: add, list, revoke\n", action);
        code = EXIT_USAGE;
    } else if (code < 0 && in.arguments.word_count != (is_add || is_revoke ? 2 : 1)) {
        fprintf(stderr, "unbaked: token %s takes %s\n", action,
                is_add      ? "the user's NAME"
                : is_revoke ? "a token's number or a user's name"
                            : "no more words");
        code = EXIT_USAGE;
    }
    const char *expires = code < 0 ? invocation_value(&in, "expires", NULL) : NULL;
    int64_t expires_ms = 0;
    if (expires && !is_add) {
        fputs("unbaked: --expires belongs to token add\n", stderr);
        code = EXIT_USAGE;
    } else if (expires && !read_expiry(expires, &expires_ms)) {
        fprintf(stderr, "unbaked: --expires takes 30d, 12h or a day such as 2027-01-31, not \"%.80s\"\n", expires);
        code = EXIT_USAGE;
    }
    if (code < 0) {
        char *command = mem_printf("token-%s", action);
        json_add_string(request, "command", command);
        mem_free(command);
        if (is_add)
            json_add_string(request, "name", in.arguments.word[1]);
        if (is_revoke)
            json_add_string(request, "which", in.arguments.word[1]);
        if (invocation_value(&in, "role", NULL))
            json_add_string(request, "role", invocation_value(&in, "role", NULL));
        json_add_int(request, "expires_ms", expires_ms);
    }
    return ask(code, &in, request, print_token_reply);
}

/* --- usage --------------------------------------------------------------------------------- */

/* As RFC 4180 has a field. */
static void print_field(const char *text) {
    bool is_quoted = strpbrk(text, "\",\r\n") != NULL;
    if (is_quoted)
        putchar('"');
    for (; *text; text++) {
        if (*text == '"')
            putchar('"');
        putchar(*text);
    }
    if (is_quoted)
        putchar('"');
}

static void print_usage(const struct invocation *in, const cJSON *reply) {
    const cJSON *item;
    (void)in;
    puts("month,user,cpu_hours");
    cJSON_ArrayForEach(item, cJSON_GetObjectItem(reply, "items")) {
        const char *month = "", *user = "";
        double cpu_sec = 0.0;
        json_string(item, "month", "a row", "", &month, NULL);
        json_string(item, "user", "a row", "", &user, NULL);
        json_number(item, "cpu_sec", "a row", 0.0, &cpu_sec, NULL);
        printf("%s,", month);
        print_field(user);
        printf(",%.4f\n", cpu_sec / 3600.0);
    }
}

int usage_command(int argc, char **argv) {
    struct invocation in;
    cJSON *request = cJSON_CreateObject();
    int code = command_begin(CONFIG_FILE_DEFAULT, &in, argc, argv, usage_flags, 0, 0);
    json_add_string(request, "command", "usage");
    return ask(code, &in, request, print_usage);
}

/* --- check-config -------------------------------------------------------------------------- */

int check_config_command(int argc, char **argv) {
    struct invocation in;
    struct buf problems;
    struct error err;
    int code = command_begin(NULL, &in, argc, argv, check_config_flags, 0, 1);
    bool has_file = in.arguments.word_count == 1;
    if (code < 0 && !has_file) {
        invocation_release(&in);
        code = command_begin(CONFIG_FILE_DEFAULT, &in, argc, argv, check_config_flags, 0, 1);
    }
    buf_init(&problems, (size_t)1 << 20);
    if (code < 0 && has_file && config_read(&in.config, in.arguments.word[0], &problems, &err) != STATUS_OK)
        buf_printf(&problems, "%s\n", err.message);
    if (code < 0 && has_file)
        config_check(&in.config, &problems);
    if (code < 0 && problems.length > 0) {
        fputs(buf_text(&problems), stderr);
        code = EXIT_USAGE;
    }
    if (code < 0)
        puts("the configuration is good");
    buf_release(&problems);
    invocation_release(&in);
    return code < 0 ? EXIT_SUCCESS : code;
}

/* collection.c -- see collection.h. */
#include "client/collection.h"

#include <ctype.h>
#include <string.h>

#include "client/retention.h"
#include "common/nearest.h"
#include "common/url.h"

const struct command_option collection_options[] = {
    {"limit", 'n', OPTION_WHOLE, "N", "list at most so many (20); 0: all"},
    {"dry-run", 0, OPTION_FLAG, NULL, "with rm: only say what would be removed"},
    KEEPING_OPTIONS,
    FORMAT_OPTION,
    {0},
};

enum verb { VERB_LIST, VERB_SHOW, VERB_KEEP, VERB_REMOVE, VERB_COUNT };
static const char *const verbs[VERB_COUNT] = {"list", "show", "keep", "rm"};

static int list(struct client *c, const struct options *o, const struct collection *what) {
    struct reply reply;
    struct error err;
    cJSON *items = NULL;
    const cJSON *item;
    int code = CLIENT_OK;
    long limit = options_whole(o, "limit", 20);
    reply_init(&reply);
    enum status status = limit < 0 ? error_set(&err, STATUS_INPUT, "--limit must be 0 or more, not %ld", limit)
                                   : client_list(c, what->path, (size_t)limit, &items, &reply, &err);
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (c->json)
        client_print_json(c, items);
    else if (c->quiet)
        cJSON_ArrayForEach(item, items) {
            client_say(c, "%s", member_text(item, "id"));
        }
    else if (cJSON_GetArraySize(items) == 0)
        client_note(c, "no %s", what->name);
    else
        what->print_all(c, items);
    cJSON_Delete(items);
    reply_release(&reply);
    return code;
}

static void print_removed(struct client *c, const struct collection *what, const char *id, const cJSON *reply,
                          bool dry_run) {
    char size[16];
    double files = member_number(reply, "files", 0.0);
    cJSON *value = dry_run ? cJSON_Duplicate(reply, true) : cJSON_CreateObject();
    json_add_string(value, "id", id);
    json_add_bool(value, "removed", !dry_run);
    format_bytes(size, member_number(reply, "bytes", 0.0));
    if (c->json)
        client_print_json(c, value);
    else if (dry_run)
        client_say(c, "%s %.12s: %.0f file%s, %s", what->one, id, files, files == 1.0 ? "" : "s", size);
    else if (!c->quiet)
        client_say(c, "%s %.12s removed", what->one, id);
    cJSON_Delete(value);
}

/* GET, PATCH with `body` or DELETE of one thing. */
static int one(struct client *c, const struct collection *what, const char *id, enum verb verb, bool dry_run,
               const cJSON *body) {
    static const char *const methods[VERB_COUNT] = {[VERB_KEEP] = "PATCH", [VERB_REMOVE] = "DELETE"};
    struct reply reply;
    struct error err;
    struct buf path;
    char kept[40];
    int code = CLIENT_OK;
    reply_init(&reply);
    buf_init(&path, 4096);
    buf_printf(&path, "%s/", what->path);
    url_encode(&path, id, false);
    buf_puts(&path, dry_run ? "?dry_run=1" : "");
    struct request_call call = {.path = buf_text(&path), .method = methods[verb], .body = body};
    enum status status = request_run(c->request, &call, &reply, &err);
    if (status != STATUS_OK)
        code = client_fail(c, &reply, &err);
    else if (verb == VERB_REMOVE)
        print_removed(c, what, id, reply.json, dry_run);
    else if (c->json)
        client_print_json(c, reply.json);
    else if (verb == VERB_SHOW)
        what->print_one(c, reply.json);
    else if (!c->quiet) {
        retention_sentence(kept, reply.json);
        bool is_used =
            cJSON_IsString(cJSON_GetObjectItemCaseSensitive(body, "expires_at")); /* its time does not apply yet */
        client_say(c, "%s %.12s is %s", what->one, id,
                   *kept     ? kept
                   : is_used ? "in use, and kept at least as long"
                             : "kept until it is removed");
    }
    buf_release(&path);
    reply_release(&reply);
    return code;
}

/* Reads the verb and its words. */
static enum status read_verb(const struct options *o, const struct collection *what, enum verb *verb,
                             struct error *err) {
    struct nearest nearest;
    char argument[32];
    const char *word = o->word_count ? o->word[0] : verbs[VERB_LIST];
    snprintf(argument, sizeof argument, "%s", what->one);
    for (char *at = argument; *at; at++)
        *at = (char)toupper((unsigned char)*at);
    nearest_init(&nearest, word);
    for (*verb = VERB_LIST; *verb < VERB_COUNT && strcmp(verbs[*verb], word) != 0; ++*verb)
        nearest_offer(&nearest, verbs[*verb]);
    if (what->further)
        nearest_offer(&nearest, what->further);
    if (*verb == VERB_LIST && o->word_count > 1)
        return error_set(err, STATUS_INPUT, "unexpected argument \"%.100s\"", o->word[1]);
    if (*verb < VERB_COUNT && *verb != VERB_LIST && o->word_count == 1)
        return error_set(err, STATUS_INPUT, "missing argument %s", argument);
    if (*verb < VERB_COUNT)
        return STATUS_OK;
    error_set(err, STATUS_INPUT, "unknown action \"%.100s\" of %s", word, what->name);
    return nearest.best ? error_hint(err, "did you mean `unbake %s %s`?", what->name, nearest.best)
                        : error_hint(err, "list, show %s..., keep %s..., rm %s...%s%s", argument, argument, argument,
                                     what->further ? ", " : "", what->further ? what->further : "");
}

/* Refuses options that the verb does not take. */
static enum status check_options(const struct options *o, const struct collection *what, enum verb verb, bool keeps,
                                 struct error *err) {
    if (verb == VERB_KEEP && !keeps)
        return error_set(err, STATUS_INPUT, "%s keep needs --pin, --unpin or --keep-days N", what->name);
    if (verb != VERB_KEEP && keeps)
        return error_set(err, STATUS_INPUT, "--pin, --unpin and --keep-days go with `%s keep`", what->name);
    if (verb != VERB_REMOVE && options_flag(o, "dry-run"))
        return error_set(err, STATUS_INPUT, "--dry-run goes with `%s rm`", what->name);
    if (verb != VERB_LIST && options_text(o, "limit", NULL))
        return error_set(err, STATUS_INPUT, "--limit goes with `%s list`", what->name);
    return STATUS_OK;
}

int collection_run(struct client *c, const struct options *o, const struct collection *what) {
    struct error err;
    enum verb verb;
    cJSON *body = cJSON_CreateObject();
    int first = CLIENT_OK;
    enum status status = read_verb(o, what, &verb, &err);
    if (status == STATUS_OK)
        status = retention_describe(o, body, &err);
    if (status == STATUS_OK)
        status = check_options(o, what, verb, body->child != NULL, &err);
    if (status != STATUS_OK)
        first = client_fail(c, NULL, &err);
    else if (verb == VERB_LIST)
        first = list(c, o, what);
    for (size_t i = 1; i < o->word_count && status == STATUS_OK; i++) {
        int code = one(c, what, o->word[i], verb, options_flag(o, "dry-run"), verb == VERB_KEEP ? body : NULL);
        if (first == CLIENT_OK)
            first = code;
        if (code == CLIENT_UNREACHABLE || code == CLIENT_INTERRUPTED)
            break;
    }
    cJSON_Delete(body);
    return first;
}

/* The client's pieces that turn text into text: events, options, corrections, figures, bars. */
#include "client/commands.h"
#include "client/meter.h"
#include "client/sse.h"
#include "client/table.h"
#include "client/view.h"
#include "common/mem.h"
#include "common/nearest.h"
#include "tests/check.h"

/* --- sse.c --------------------------------------------------------------------------------- */

struct heard {
    char text[1024];
    int stop_after;
};

static bool hear(void *user, const char *type, const char *data, const char *id) {
    struct heard *h = user;
    size_t used = strlen(h->text);
    snprintf(h->text + used, sizeof h->text - used, "%s(%s)#%s;", type, data, id);
    return --h->stop_after != 0;
}

/* The same stream must give the same events however it is cut into pieces. */
static void check_stream(const char *stream, const char *wanted) {
    for (size_t piece = 1; piece <= strlen(stream); piece++) {
        struct heard h = {.stop_after = -1};
        struct sse s;
        sse_init(&s, hear, &h);
        for (size_t i = 0; i < strlen(stream); i += piece) {
            size_t rest = strlen(stream) - i;
            CHECK(sse_feed(&s, stream + i, rest < piece ? rest : piece));
        }
        CHECK_STRING(h.text, wanted);
        sse_release(&s);
    }
}

static void test_sse(void) {
    check_stream("id: 7\nevent: state\ndata: {}\n\n: keepalive\n\ndata: a\ndata: b\n\n",
                 "state({})#7;message(a\nb)#7;");
    check_stream("data:x\r\ndata:  y\r\nid:1\r\n\r\ndata: z\r\r", "message(x\n y)#1;message(z)#1;");
    check_stream("\xEF\xBB\xBF"
                 "data: mark\n\n",
                 "message(mark)#;");
    check_stream("event: lost\nid: 9\n\ndata\n\n", "message()#9;");
    check_stream("retry: 10\nunknown: 1\nid: 3\ndata: 1\n\nid: 4\ndata: cut", "message(1)#3;");

    struct heard h = {.stop_after = 2};
    struct sse s;
    sse_init(&s, hear, &h);
    CHECK(!sse_feed(&s, "data: 1\n\ndata: 2\n\ndata: 3\n\n", 27));
    CHECK_STRING(h.text, "message(1)#;message(2)#;");
    sse_release(&s);

    /* A connection that breaks inside an event: the half is forgotten, its id too. */
    h = (struct heard){.stop_after = -1};
    sse_init(&s, hear, &h);
    CHECK(sse_feed(&s, "id: 5\ndata: a\n\nid: 6\ndata: ha", 30));
    sse_restart(&s);
    CHECK_STRING(s.last_id, "5");
    CHECK(sse_feed(&s, "data: b\n\n", 9));
    CHECK_STRING(h.text, "message(a)#5;message(b)#5;");
    sse_release(&s);

    /* An event without end is refused, not kept for ever. */
    sse_init(&s, hear, &h);
    char *flood = mem_calloc(SSE_EVENT_MAX + 1, 1);
    memset(flood, 'x', SSE_EVENT_MAX + 1);
    CHECK(!sse_feed(&s, flood, SSE_EVENT_MAX + 1));
    mem_free(flood);
    sse_release(&s);
}

/* --- options.c, nearest.c ------------------------------------------------------------------ */

static const struct command_option own[] = {
    {"watch", 'w', OPTION_FLAG, NULL, ""},      {"name", 'n', OPTION_TEXT, "NAME", ""},
    {"set", 's', OPTION_LIST, "KEY=VALUE", ""}, {"priority", 'p', OPTION_WHOLE, "N", ""},
    {"retry", 0, OPTION_SECONDS, "SEC", ""},    {0},
};
static const struct command_option shared[] = {{"json", 0, OPTION_FLAG, NULL, ""}, {0}};

static enum status parse(struct options *o, struct error *err, int count, const char *const *words) {
    char *argv[16];
    for (int i = 0; i < count; i++)
        argv[i] = (char *)words[i];
    return options_parse(o, count, argv, own, shared, err);
}

static void test_options(void) {
    struct options o;
    struct error err;
    static const char *const good[] = {"room",   "-w", "--name=a b", "-sx=1", "--set", "y=2",
                                       "--json", "-p", "-5",         "--",    "-file"};
    CHECK(parse(&o, &err, 11, good) == STATUS_OK);
    CHECK(options_flag(&o, "watch") && options_flag(&o, "json") && !options_flag(&o, "retry"));
    CHECK_STRING(options_text(&o, "name", NULL), "a b");
    CHECK_STRING(options_text(&o, "set", NULL), "y=2");
    CHECK(options_whole(&o, "priority", 0) == -5);
    CHECK_NEAR(options_seconds(&o, "retry", 2.5), 2.5, 0.0);
    CHECK(o.word_count == 2 && strcmp(o.word[1], "-file") == 0);
    options_release(&o);

    static const struct {
        const char *word, *message, *hint;
    } bad[] = {
        {"--wach", "unknown option --wach", "did you mean --watch?"},
        {"--jsno=1", "unknown option --jsno", "did you mean --json?"},
        {"--quite-else", "unknown option --quite-else", "--help lists the options"},
        {"-x", "unknown option -x", "--help lists the options"},
        {"--watch=1", "--watch takes no value", ""},
        {"--name", "--name needs a value: --name NAME", ""},
        {"--priority=1.5", "--priority must be a whole number, not \"1.5\"", ""},
        {"--priority=99999999999", "--priority must be a whole number, not \"99999999999\"", ""},
        {"--retry=-1", "--retry must be a number, 0 or more, not \"-1\"", ""},
        {"--retry=nan", "--retry must be a number, 0 or more, not \"nan\"", ""},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        CHECK(parse(&o, &err, 1, &bad[i].word) == STATUS_INPUT);
        CHECK_STRING(err.message, bad[i].message);
        CHECK_STRING(err.hint, bad[i].hint);
        options_release(&o);
    }
}

static const char *correction(const char *typed) {
    static const char *const names[] = {"submit", "settings", "scenes", "seed", "size", "show", "list", "rm"};
    struct nearest n;
    nearest_init(&n, typed);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        nearest_offer(&n, names[i]);
    return n.best ? n.best : "none";
}

static void test_nearest(void) {
    CHECK_STRING(correction("sumbit"), "submit");
    CHECK_STRING(correction("scene"), "scenes");
    CHECK_STRING(correction("set"), "settings");
    CHECK_STRING(correction("lsit"), "list");
    CHECK_STRING(correction("rn"), "rm");
    CHECK_STRING(correction("wam"), "none");  /* one letter in three is not enough to guess by */
    CHECK_STRING(correction("siez"), "size"); /* two swapped letters are nearer than two others */
    CHECK_STRING(correction("frobnicate"), "none");
    CHECK_STRING(correction(""), "none");
}

/* --- the table of commands ----------------------------------------------------------------- */

static void test_commands(void) {
    size_t count;
    const struct command *table = command_table(&count);
    CHECK(count >= 14);
    for (size_t i = 0; i < count; i++) {
        const struct command *c = &table[i];
        char call[64];
        snprintf(call, sizeof call, "  unbake %s", c->name);
        CHECK_THAT(strncmp(c->examples, call, strlen(call)) == 0, "%s has no example", c->name);
        CHECK(c->examples[strlen(c->examples) - 1] == '\n');
        CHECK(c->run && *c->summary && c->words_min <= c->words_max);
        CHECK((c->words_max > 0) == (*c->arguments != '\0'));
        CHECK(command_find(c->name) == c);
        for (const struct command_option *a = c->options; a->name; a++) {
            CHECK((a->kind == OPTION_FLAG) == (a->value == NULL));
            for (const struct command_option *b = command_shared_options; b->name; b++)
                CHECK_THAT(strcmp(a->name, b->name) != 0 && (!a->letter || a->letter != b->letter),
                           "%s: --%s is given twice", c->name, a->name);
            for (const struct command_option *b = a + 1; b->name; b++)
                CHECK_THAT(strcmp(a->name, b->name) != 0 && (!a->letter || a->letter != b->letter),
                           "%s: --%s is given twice", c->name, a->name);
        }
    }
    CHECK(command_find("nothing") == NULL);
}

/* --- figures ------------------------------------------------------------------------------- */

static void test_figures(void) {
    static const struct {
        double value;
        const char *bytes, *duration, *figure;
    } t[] = {
        {0.0, "0 B", "0s", "0"},
        {-1.0, "0 B", "--", "-1.000"},
        {999.0, "999 B", "16m39s", "999.0"},
        {1023.0, "1.0 KiB", "17m03s", "1023"},
        {1048524.9, "1.0 MiB", "12d03h", "1.05e+06"},
        {65.4321, "65 B", "1m05s", "65.43"},
        {3600.0, "3.5 KiB", "1h00m", "3600"},
        {0.0123456, "0 B", "0s", "0.01235"},
        {3.2e-7, "0 B", "0s", "3.2e-07"},
        {5e18, "4.3 EiB", "--", "5e+18"},
    };
    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        char bytes[16], duration[16], figure[24];
        format_bytes(bytes, t[i].value);
        format_duration(duration, t[i].value);
        format_figure(figure, t[i].value);
        CHECK_STRING(bytes, t[i].bytes);
        CHECK_STRING(duration, t[i].duration);
        CHECK_STRING(figure, t[i].figure);
    }
    CHECK_NEAR(time_parse("1970-01-02T00:00:01.250Z"), 86401.25, 1e-9);
    CHECK(isnan(time_parse("")) && isnan(time_parse("1970-01-02T00:00:01+01:00")));
}

static void check_bar(size_t columns, double fraction, bool unicode, const char *wanted) {
    struct buf b;
    buf_init(&b, 1024);
    format_bar(&b, columns, fraction, unicode);
    CHECK_STRING(buf_text(&b), wanted);
    CHECK(text_columns(buf_text(&b)) == (columns < 3 ? 0 : columns));
    buf_release(&b);
}

static void test_bar(void) {
    check_bar(12, 0.0, false, "[----------]");
    check_bar(12, 0.5, false, "[#####-----]");
    check_bar(12, 0.999, false, "[#########-]");
    check_bar(12, 1.0, false, "[##########]");
    check_bar(12, 7.0, false, "[##########]");
    check_bar(12, -1.0, false, "[----------]");
    check_bar(12, (double)NAN, false, "[----------]");
    check_bar(2, 0.5, false, "");
    check_bar(4, 0.75, true, "[\xE2\x96\x88\xE2\x96\x8C]");
}

static void test_text(void) {
    struct buf b;
    buf_init(&b, 1024);
    terminal_clean(&b, "a\033[2Jb\n\xC2\x9B"
                       "c \xFF \xE2\x82\xAC \xE2\x82");
    CHECK_STRING(buf_text(&b), "a?[2Jb?<U+009B>c ? \xE2\x82\xAC ??");
    buf_clear(&b);
    /* An override, an isolate, a separator, a mark, a soft hyphen, a tag; an emoji is left alone. */
    terminal_clean(&b, "\u202Egpj.exe \u2066 \u2028 \u200E \u00AD \U000E0041 \U0001F600");
    CHECK_STRING(buf_text(&b), "<U+202E>gpj.exe <U+2066> <U+2028> <U+200E> <U+00AD> <U+E0041> \U0001F600");
    buf_clear(&b);
    buf_puts(&b, "\033[31m\xE2\x82\xAC"
                 "bc\033[0m");
    CHECK(text_columns(buf_text(&b)) == 3);
    text_cut(&b, 2);
    CHECK_STRING(buf_text(&b), "\033[31m\xE2\x82\xAC"
                               "b\033[0m");
    buf_release(&b);
}

static void test_meter(void) {
    struct meter m;
    struct buf b;
    meter_begin(&m, NULL, "room.tar", 0.0, 1000 * 1024.0);
    double start = m.measured_at;
    for (int i = 1; i <= 40; i++) /* a steady 10 KiB a second */
        meter_measure(&m, start + i, i * 10240.0);
    CHECK_NEAR(m.rate, 10240.0, 1.0);
    buf_init(&b, 1024);
    meter_text(&m, &b, 100, false);
    CHECK_STRING(buf_text(&b), "room.tar  [########--------------]  40%  400.0 KiB of 1000.0 KiB  "
                               "10.0 KiB/s  ETA 1m00s");
    buf_clear(&b);
    meter_text(&m, &b, 30, false);
    CHECK(text_columns(buf_text(&b)) == 30);
    /* A stall is noticed: the time left grows. */
    for (int i = 41; i <= 60; i++)
        meter_measure(&m, start + i, 409600.0);
    CHECK(m.rate < 100.0);
    buf_release(&b);
}

/* --- view.c -------------------------------------------------------------------------------- */

static void event(struct client_view *v, const char *type, const char *data) {
    cJSON *value = cJSON_Parse(data);
    view_event(v, type, value);
    cJSON_Delete(value);
}

static void check_line(const struct client_view *v, size_t columns, bool bar, double age, const char *wanted) {
    struct terminal t = {.out = stdout};
    struct buf b;
    buf_init(&b, 1024);
    view_line(v, &t, columns, bar, age, &b);
    CHECK_STRING(buf_text(&b), wanted);
    CHECK(text_columns(buf_text(&b)) <= columns);
    buf_release(&b);
}

static void test_view(void) {
    struct client_view v;
    view_init(&v, 17);
    event(&v, "state",
          "{\"state\":\"queued\",\"snapshot\":true,\"progress\":0,\"eta_sec\":null,"
          "\"stage\":null,\"reason\":null,\"wanted\":\"run\"}");
    check_line(&v, 80, true, 0.0, "job 17  queued");
    event(&v, "state", "{\"state\":\"running\",\"attempt\":1}");
    event(&v, "progress", "{\"stage\":\"refine\",\"done\":250,\"total\":1000,\"eta_sec\":75}");
    event(&v, "metric", "{\"series\":\"loss\",\"step\":250,\"value\":0.0123}");
    event(&v, "metric", "{\"series\":\"loss\",\"step\":251,\"value\":0.0122}");
    event(&v, "metric", "{\"series\":\"bad\",\"step\":251,\"value\":null}");
    check_line(&v, 80, true, 5.0, "job 17  refine  [#######------------------------]  25%  loss 0.01220  ETA 1m10s");
    check_line(&v, 80, false, 500.0, "job 17  refine   25%  loss 0.01220");
    check_line(&v, 30, true, 0.0, "job 17  refine   25%  loss 0.0");
    /* More series than there is room for: the one reported longest ago gives way. */
    event(&v, "metric", "{\"series\":\"b\",\"step\":1,\"value\":1}");
    event(&v, "metric", "{\"series\":\"c\",\"step\":1,\"value\":2}");
    event(&v, "metric", "{\"series\":\"d\",\"step\":1,\"value\":3}");
    check_line(&v, 80, false, 0.0, "job 17  refine   25%  d 3.000  b 1.000  c 2.000  ETA 1m15s");
    event(&v, "state", "{\"state\":\"running\",\"wanted\":\"pause\"}");
    CHECK(!view_is_over(&v) && v.attempt == 1);
    event(&v, "state", "{\"state\":\"paused\",\"reason\":\"the disk is full\",\"wanted\":\"run\"}");
    check_line(&v, 80, true, 0.0, "job 17  paused: the disk is full");
    event(&v, "something new", "{}");
    event(&v, "state", "{\"state\":\"failed\",\"reason\":\"out of memory\"}");
    CHECK(view_is_over(&v));
}

static void test_names(void) {
    static const char *const good[] = {"base_color.exr", "preview/x.png", "a/b/c", "a..b"};
    static const char *const bad[] = {"",       "/etc/passwd", "../x", "a/../b", "a//b", "a/",
                                      ".ssh/x", "a/.",         "a\\b", "a\nb",   "..",   "a\x7F"};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++)
        CHECK_THAT(get_name_is_safe(good[i]), "%s", good[i]);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK_THAT(!get_name_is_safe(bad[i]), "%s", bad[i]);
}

int main(void) {
    test_sse();
    test_options();
    test_nearest();
    test_commands();
    test_figures();
    test_bar();
    test_text();
    test_meter();
    test_view();
    test_names();
    return check_result();
}

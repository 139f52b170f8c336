/* commands.c -- see commands.h. */
#include "server/commands.h"

#include <string.h>

#include "server/admin/commands.h"
#include "server/check/check_command.h"
#include "server/demo/demo_command.h"
#include "server/evaluate/evaluate_command.h"
#include "server/executor/executor_command.h"
#include "server/node/node_command.h"
#include "server/relight/relight_command.h"
#include "server/worker/worker.h"

static const struct server_command table[] = {
    {"", "", "take scenes over HTTP and reconstruct their materials and lighting",
     "Runs in the foreground and logs to stderr. SIGTERM and SIGINT stop it: running jobs write a\n"
     "checkpoint and go back to the queue. SIGHUP reads the TLS certificate again.\n",
     "  unbaked --data ~/unbaked --set max_running=2\n", daemon_flags, daemon_command},
    {"token", "add NAME|list|revoke WHICH", "make, list and revoke the tokens of users",
     "`token add` makes a token for the user NAME and prints it, once. WHICH is a token's number or a\n"
     "user's name; what is revoked stops working at once, in open streams too. While there has never\n"
     "been a token, whoever reaches the daemon may do everything; so the first one makes an admin, unless\n"
     "--role says otherwise, and later ones make users.\n",
     "  unbaked token add alice --role admin\n  unbaked token add bob --expires 90d\n"
     "  unbaked token add wall-display --role viewer\n  unbaked token revoke alice\n",
     token_flags, token_command},
    {"check-config", "[FILE]", "say what is wrong with a configuration", "",
     "  unbaked check-config /etc/unbaked.conf\n", check_config_flags, check_config_command},
    {"doctor", "", "say what works on this machine and what does not",
     "Looks at libraries, limits, permissions, the disk, what the kernel offers for the sandbox, and of each\n"
     "executor at its commands, its url, the program of its nodes and the folder that they share.\n"
     "Ends with 1 when something keeps the daemon from working.\n",
     "  unbaked doctor --config /etc/unbaked.conf\n", doctor_flags, doctor_command},
    {"executor", "list|test NAME", "list where jobs run, or try a cluster's scheduler",
     "`executor test` submits a job of some seconds by the commands of NAME.conf in executors_dir, says each\n"
     "step and what it took, and cancels a second one. NAME need not be used by the daemon yet. With `shared`\n"
     "in the file, also whether the nodes have the same version, whether their clocks agree, and whether they\n"
     "reach the daemon at `url`, which must run, and trust its certificate. (`executor probe` is what that\n"
     "job runs.)\n",
     "  unbaked executor test slurm\n", executor_flags, executor_command},
    {"usage", "", "print the CPU hours of users' jobs by month, as CSV",
     "A line for each month (UTC) and user: month, user, cpu_hours. The user is empty for jobs that were\n"
     "submitted without a token. Time counts in the month in which it was entered: when an attempt ended, or\n"
     "while others waited for their turns. Jobs that were removed count, too.\n",
     "  unbaked usage >usage.csv\n  unbaked usage --json\n", usage_flags, usage_command},
    {"backup", "FILE", "write a consistent copy of the database, also while the daemon works",
     "FILE is a whole state.db: users, scenes, jobs, events. The files of scenes never change once they\n"
     "are there, those of a job only while it runs: copy those folders after it, with rsync, say. With\n"
     "--with-outputs FILE is a folder with the files of scenes and jobs too, which share their blocks with\n"
     "the data folder where both are on one file system, and a SHA256SUMS of all. A job that runs begins\n"
     "anew when it is restored. What is there already is not overwritten.\n",
     "  unbaked backup /backup/state.db && rsync -a /var/lib/unbaked/scenes /var/lib/unbaked/jobs /backup/\n"
     "  unbaked backup --with-outputs /backup/$(date +%F)\n",
     backup_flags, backup_command},
    {"restore", "BACKUP DIR", "make a data folder out of a backup with outputs",
     "DIR is made, or must be empty. Every file is held against its digest in the backup; where one is\n"
     "damaged, nothing is restored, or with --skip-damaged all others. Root gives the files to DIR's owner.\n",
     "  unbaked restore /backup/2026-01-31 /var/lib/unbaked\n", restore_flags, restore_command},
    {"check", "ROOM", "say what a folder holds, and whether its mesh and photographs belong together",
     "Reads the folder ROOM as the daemon reads an upload, with no daemon: cameras, mesh, photographs, every\n"
     "problem. Then compares the photographs on the mesh, with their poses as they are given and with others:\n"
     "turned axes, other scales, frames out of step. Ends with 1 when the room would be rejected or does not fit.\n",
     "  unbaked check ~/scan --scene-set scale=0.001\n", check_flags, check_command},
    {"demo-room", "DIR", "make a room whose materials and lights are known",
     "Photographs a furnished room and writes a bundle to DIR that `unbake submit DIR` takes, with the\n"
     "ground truth in DIR/truth.\n",
     "  unbaked demo-room /tmp/room --sdr --wall-radiance 25 --ceiling-radiance 3\n", demo_flags, demo_command},
    {"evaluate", "ROOM OUTPUTS", "compare a job's outputs with a known room",
     "Compares OUTPUTS, a folder that `unbake get` filled, with ROOM/truth, as the held-out cameras see it.\n",
     "  unbaked evaluate /tmp/room /tmp/room-textures --pictures /tmp/pictures\n", evaluate_flags, evaluate_command},
    {"manual", "PAGE", "write unbaked.8, unbaked.conf.5, or the completion for bash or zsh", "",
     "  unbaked manual unbaked.8 | man -l -\n", NULL, manual_command},
    {"relight", "OUTPUTS", "render a finished job's room from any view under any light",
     "OUTPUTS is a folder that `unbake get` filled; nothing else of the job is needed.\n",
     "  unbaked relight /tmp/room-textures --lights off --environment sky.hdr --out sky.png\n", relight_flags,
     relight_command},
    {"node", "URL", "one attempt of a job, on a machine that a scheduler gave; job scripts run it",
     "Claims the attempt from the daemon at URL (http://, https:// or unix:PATH), fetches its scene and checkpoint,\n"
     "runs its worker as the daemon would, and sends what it says and writes. The address must be one that\n"
     "this machine reaches, and the version the daemon's. SIGTERM and SIGUSR1 stop it after a checkpoint.\n"
     "Ends with the worker's status: 0 done, 65 the input is at fault, 71 memory ran out, 74 a disk is full,\n"
     "85 stopped or taken back; with 1 when it was not taken, or the daemon has not answered for a minute.\n",
     "  unbaked node https://lab.example.org:7117 --job 17 --attempt 2 --token-file /run/token\n", node_flags,
     node_command},
    {"worker", "DIR", "one attempt of a job; the daemon runs it", "", "", NULL, worker_main},
};
#define COMMAND_COUNT (sizeof table / sizeof *table)

const struct server_command *commands_table(size_t *count) {
    *count = COMMAND_COUNT;
    return table;
}

const struct server_command *commands_find(const char *name) {
    for (size_t i = 1; i < COMMAND_COUNT; i++)
        if (strcmp(table[i].name, name) == 0)
            return &table[i];
    return NULL;
}

static void print_commands_and_options(FILE *out) {
    size_t count;
    const struct config_option *options = config_table(&count);
    fputs("\ncommands:\n", out);
    for (size_t i = 1; i < COMMAND_COUNT; i++)
        fprintf(out, "  unbaked %s%s%s: %s\n", table[i].name, *table[i].arguments ? " " : "", table[i].arguments,
                table[i].summary);
    fputs("\noptions for --set and the file:\n", out);
    for (size_t i = 0; i < count; i++)
        fprintf(out, "  %-24s %s [%s%s%s]\n", options[i].name, options[i].help, options[i].default_text,
                *options[i].unit ? " " : "", options[i].unit);
}

void commands_help(const struct server_command *command, FILE *out) {
    bool is_daemon = command == table;
    fprintf(out, "usage: unbaked%s%s%s%s%s\n\n%s.\n", is_daemon ? "" : " ", command->name,
            *command->arguments ? " " : "", command->arguments, command->flags ? " [OPTION]..." : "", command->summary);
    if (*command->details)
        fprintf(out, "\n%s", command->details);
    if (command->flags)
        fputs("\n", out);
    options_print(command->flags, NULL, out);
    if (is_daemon)
        print_commands_and_options(out);
    if (*command->example)
        fprintf(out, "\nexample:\n%s", command->example);
    fprintf(out, "\nexit status: 0 done%s, 1 failed, %d bad usage or configuration\n",
            is_daemon ? " (stopped when asked to)" : "", EXIT_USAGE);
}

# error_sites.awk -- of what `gcov -t -b -c` says of the source files whose names match `files`: one line
# "file:line<TAB>1 or 0<TAB>source" for each place where an error is dealt with, 1 where that has happened. Such a place
# is a line that
#
#   - calls one of common/error.h (error_set, ...), or returns a STATUS_ of failure;
#   - compares with STATUS_OK;
#   - answers with a problem (server/transport/problem.h), or logs a warning or an error.
#
# It has happened when the line has run and each of its branches was taken: where a status is looked at, it was
# good once and bad once.

function is_site(text) {
    return text ~ /^ / && text ~ /((error_(set|set_errno|prefix|hint)|problem(_[a-z]+)?|log_(warning|error))\(|[!=]= STATUS_OK|return ([^=]*[ (])?STATUS_(INPUT|IO|N|CON|L|UN|CAN|COR|INT))/
}

function tell() {
    if (site != "")
        printf "%s\t%d\t%s\n", site, happened, source
    site = ""
}

/^(branch|call) / {
    if ($1 == "branch" && (/never executed/ || $4 == 0))
        happened = 0
    next
}
/^function / { next }
{
    tell()
    count = $0
    sub(/:.*/, "", count)
    gsub(/ /, "", count)
    source = $0
    sub(/^[^:]*:/, "", source)
    number = source + 0
    sub(/^[^:]*:/, "", source)
}
number == 0 {
    if (source ~ /^Source:/)
        file = substr(source, 8)
    next
}
file ~ files && count != "-" && is_site(source) {
    site = file ":" number
    happened = count !~ /[#=]/
    sub(/^ +/, "", source)
}
END { tell() }

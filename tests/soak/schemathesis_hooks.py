"""What tests/soak/test_schemathesis.sh adds to the requests that schemathesis makes."""
import itertools

import schemathesis

number = itertools.count()


@schemathesis.hook
def before_call(context, case, kwargs):
    """Each request comes from another address, by the word of a proxy: many wrong tokens from one are throttled.
    Long polls are short."""
    n = next(number)
    case.headers["X-Forwarded-For"] = f"10.{n >> 16 & 255}.{n >> 8 & 255}.{n & 255}"
    if case.query and str(case.query.get("wait", "")).isdigit() and 1 < int(case.query["wait"]) <= 300:
        case.query["wait"] = 1


@schemathesis.hook
def map_path_parameters(context, parameters):
    """Every other request for a job or a scene's job is for one that is there."""
    if parameters and isinstance(parameters.get("job"), int) and parameters["job"] % 2:
        return {**parameters, "job": 1 + parameters["job"] % 3}
    return parameters


@schemathesis.hook
def filter_query(context, query):
    """A dry run removes nothing, which the check for what is still there after its removal does not know."""
    return context.operation.method.upper() != "DELETE" or not query or "dry_run" not in query

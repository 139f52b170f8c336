/* quantile.h: order does not matter, ends are kept within, nothing has no quantile. */
#include "common/quantile.h"

#include "tests/check.h"

int main(void) {
    float value[] = {3.0f, -1.0f, 2.0f, 5.0f, 4.0f};
    CHECK(quantile(value, 5, 0.5) == 3.0f);
    CHECK(quantile(value, 5, 0.0) == -1.0f);
    CHECK(quantile(value, 5, 1.0) == 5.0f);
    CHECK(quantile(value, 4, 0.5) == 3.0f); /* of -1 2 3 4: the upper median */
    CHECK(quantile(value, 0, 0.5) == 0.0f);
    return check_result();
}

/* Tests of core/error.c: every code has its own message. */
#include "core/error.h"

#include <string.h>

#include "tests/check.h"

TEST(errors_have_messages)
{
    CHECK(GR_OK == 0);
    for (int code = 0; code < GR_ERROR_COUNT; code++) {
        CHECK(strlen(gr_error_message(code)) > 5);
        for (int other = 0; other < code; other++) CHECK(strcmp(gr_error_message(code), gr_error_message(other)));
    }
    CHECK(!strcmp(gr_error_message(-1), "unknown error code"));
    CHECK(!strcmp(gr_error_message(GR_ERROR_COUNT), "unknown error code"));
}

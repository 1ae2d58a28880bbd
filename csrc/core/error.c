/* Messages of the error codes. */
#include "core/error.h"

#define GR_X(code, exception, message) message,
static const char *const messages[] = {GR_ERRORS(GR_X)};
#undef GR_X

const char *gr_error_message(int code) { return code >= 0 && code < GR_ERROR_COUNT ? messages[code] : "unknown error code"; }

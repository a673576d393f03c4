#include <ivis/ivis.h>

#include <stdio.h>
#include <string.h>

/* Nobody listens there: the error names the address. */
int main(void) {
  ivis_client_options options = ivis_client_options_default();
  ivis_client* client = NULL;
  char error[256] = "";
  options.endpoint = "tcp://127.0.0.1:1";
  options.connect_timeout_ms = 50;
  if (ivis_client_connect(&options, &client, error, sizeof error) != IVIS_ERROR_CONNECTION) return 1;
  puts(error);
  return strstr(error, "127.0.0.1:1") == NULL;
}

"""The mesh for browsers and ``curl``: estimates, events and health over HTTP, and a page that draws them."""

"""What a thing offers a body: a seat, arm rests, a place to stand at, a way through."""

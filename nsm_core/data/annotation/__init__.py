"""What a clip shows, proposed by rule: actions, contacts, phases and goals."""

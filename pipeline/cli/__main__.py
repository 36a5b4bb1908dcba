from advpipe.pipeline.cli import app

app()

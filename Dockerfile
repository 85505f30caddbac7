# The app on a CPU, for docs/app.md#in-a-container. `make long` runs these steps in a folder with a fresh Debian.
FROM debian:bookworm-slim

RUN apt-get update \
    && apt-get install -y --no-install-recommends python3 python3-venv \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home semgs

# torch without CUDA, in the version that constraints.txt names
ENV PIP_EXTRA_INDEX_URL=https://download.pytorch.org/whl/cpu PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
ENV PATH=/opt/semgs/bin:/usr/local/bin:/usr/bin:/bin

COPY pyproject.toml constraints.txt README.md LICENSE NOTICE /src/
COPY scripts/index_page.py /src/scripts/
COPY semgs /src/semgs/
RUN python3 -m venv /opt/semgs && pip install -c /src/constraints.txt '/src[app]'

USER semgs
WORKDIR /home/semgs
EXPOSE 7860
CMD ["semgs", "app", "--host", "0.0.0.0"]

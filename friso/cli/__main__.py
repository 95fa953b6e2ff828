from friso.cli.app import main

main()
